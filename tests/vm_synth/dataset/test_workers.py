"""vm-synth as a user runs it: the same pictures however they are made, and nothing lost when it is stopped."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import vm_synth
from tests.folders import contents
from vm_embedded.errors import InputError
from vm_synth.dataset.files import PARTS, file_of, indices_in
from vm_synth.render.mitsuba import load_mitsuba

pytestmark = pytest.mark.long

SMALL = """
[camera]
picture_width = 128
picture_height = 96
"""
COMMAND = [sys.executable, "-m", "vm_synth"]


@pytest.fixture(scope="module")
def small(tmp_path_factory, maps):
    """Arguments for a small set of six pictures."""
    try:
        load_mitsuba()
    except InputError as error:
        pytest.skip(str(error))
    config = tmp_path_factory.mktemp("config") / "scene.toml"
    config.write_text(SMALL)
    return ["--count", "6", "--hdri", str(maps), "--seed", "3", "--config", str(config)]


def environment_of(**changes):
    places = str(Path(vm_synth.__file__).parents[1])
    return {**os.environ, "PYTHONPATH": places + os.pathsep + os.environ.get("PYTHONPATH", ""), **changes}


def run(folder, arguments, **options):
    return subprocess.run(
        [*COMMAND, str(folder), *arguments],
        capture_output=True,
        text=True,
        timeout=240,
        env=environment_of(),
        **options,
    )


def started(command):
    """A process that leads its own group, and that Ctrl-C reaches even if these tests run in the background."""
    return subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        env=environment_of(),
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory, small):
    """The set, made in one go by one worker."""
    folder = tmp_path_factory.mktemp("whole")
    done = run(folder, [*small, "--workers", "1"])
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{folder}: 6 pictures\n"
    assert "6 pictures in" in done.stderr
    return contents(folder)


def test_a_set_has_all_parts_of_all_pictures(whole):
    assert set(whole) == {"set.json", *(file_of(Path(), part, index).name for part in PARTS for index in range(6))}
    truth = [json.loads(whole[f"scene000000{index}.json"]) for index in range(6)]
    assert {each["map"] for each in truth} <= {"noon", "evening"}
    assert [each["index"] for each in truth] == list(range(6))


def test_two_workers_make_the_same_bytes(tmp_path, small, whole):
    assert run(tmp_path, [*small, "--workers", "2"]).returncode == 0
    assert contents(tmp_path) == whole


def test_shards_join_to_the_same_set(tmp_path, small, whole):
    joined = {}
    for shard in ("1/2", "2/2"):
        done = run(tmp_path / shard[0], [*small, "--workers", "1", "--shard", shard])
        assert done.stdout.endswith("3 pictures\n")
        joined |= contents(tmp_path / shard[0])
    assert joined == whole


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_what_is_stopped_goes_on_with_the_same_command(how, tmp_path, small, whole):
    arguments = [*COMMAND, str(tmp_path), *small, "--workers", "1"]
    process = started(arguments)
    wait_for_picture(tmp_path, process)
    process.send_signal(how)
    error = process.communicate(timeout=60)[1]
    assert process.returncode == (-signal.SIGKILL if how == signal.SIGKILL else 130)
    assert "Traceback" not in error
    if how != signal.SIGKILL:
        assert "repeat the command to continue" in error
    wait_for_end_of(process.pid)

    before = {index: file_of(tmp_path, "scene", index).stat().st_mtime_ns for index in indices_in(tmp_path)}
    assert 1 <= len(before) < 6
    again = run(tmp_path, [*small, "--workers", "1"])
    assert again.returncode == 0
    assert f"{len(before)} of 6 pictures already exist" in again.stderr
    assert {index: file_of(tmp_path, "scene", index).stat().st_mtime_ns for index in before} == before
    assert contents(tmp_path) == whole


def wait_for_picture(folder, process):
    deadline = time.monotonic() + 120
    while not indices_in(folder):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)


def wait_for_end_of(group):
    """No process of a stopped run may outlive it."""
    deadline = time.monotonic() + 30
    while True:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        assert time.monotonic() < deadline, "a worker goes on"
        time.sleep(0.05)


def test_a_killed_worker_is_reported_in_one_line_and_nothing_is_lost(tmp_path, small, whole):
    arguments = [*COMMAND, str(tmp_path), *small, "--workers", "1"]
    process = started(arguments)
    wait_for_picture(tmp_path, process)
    [worker] = [pid for pid in children(process.pid) if "spawn_main" in Path(f"/proc/{pid}/cmdline").read_text()]
    os.kill(worker, signal.SIGKILL)
    error = process.communicate(timeout=60)[1]
    assert process.returncode == 1
    assert "a worker process was killed" in error
    assert "Traceback" not in error
    assert run(tmp_path, [*small, "--workers", "1"]).returncode == 0
    assert contents(tmp_path) == whole


def children(pid):
    return [int(each) for each in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_a_full_disk_ends_in_one_line_and_can_be_continued(tmp_path, small, whole):
    """A limit on the size of files stands for the disk: writing fails in the middle of an image."""
    limited = ["bash", "-c", 'ulimit -f 2; exec "$@"', "bash", *COMMAND, str(tmp_path), *small, "--workers", "1"]
    done = subprocess.run(limited, capture_output=True, text=True, timeout=240, env=environment_of())
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("vm-synth: can't write")
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.glob("*.part"))
    assert run(tmp_path, [*small, "--workers", "1"]).returncode == 0
    assert contents(tmp_path) == whole


def test_another_set_is_not_mixed_in(tmp_path, small, whole):
    (tmp_path / "set.json").write_bytes(whole["set.json"])
    done = run(tmp_path, [*small[:4], "--seed", "4", *small[6:]])
    assert done.returncode == 1
    assert "a set with another seed: 3, not 4" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["set.json"]


def test_a_folder_of_other_pictures_is_left_alone(tmp_path, small, whole):
    (tmp_path / "image0000001.jpg").write_bytes(b"mine")
    done = run(tmp_path, small)
    assert done.returncode == 1
    assert "image0000001.jpg but no set.json" in done.stderr
    assert contents(tmp_path) == {"image0000001.jpg": b"mine"}


def test_pictures_that_lost_a_file_are_rendered_again(tmp_path, small, whole):
    for name, content in whole.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "mask0000002.png").unlink()
    (tmp_path / "image0000004.jpg").write_bytes(b"")
    done = run(tmp_path, [*small, "--workers", "1"])
    assert "4 of 6 pictures already exist" in done.stderr
    assert contents(tmp_path) == whole
