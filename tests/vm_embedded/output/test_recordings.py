"""The folder of recordings: only what is a recording counts and is deleted, and nothing in one ends the disk limit."""

import os
import shutil
import signal
import subprocess
import sys
import threading

import pytest

from tests.folders import contents
from tests.programs import heed_permissions
from tests.vm_embedded.live.running import running
from vm_embedded.files import locked_folder
from vm_embedded.output.recordings import (
    begin_recording,
    delete_oldest_recordings,
    finish,
    finish_left_recordings,
)

NAMES = [f"2026-01-0{day}T00-00-00.000" for day in (1, 2, 3)]


def make_recording(folder, size=1000):
    folder.mkdir(parents=True)
    (folder / "recording.jsonl").write_bytes(b"{}\n")
    with (folder / "image0000000.png").open("wb") as file:
        file.truncate(size - 3)
    return folder


def names(folder):
    return sorted(each.name for each in folder.iterdir())


def test_the_newest_recording_stays_although_the_clock_was_set_back(tmp_path):
    for name in ("2026-11-27T03-28-20.541", "2026-11-27T03-30-00.000", "1970-01-01T00-01-40.011"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "recording.jsonl").write_bytes(bytes(1000))
    newest = tmp_path / "1970-01-01T00-01-40.011"
    delete_oldest_recordings(tmp_path, 2000, newest)
    assert sorted(each.name for each in tmp_path.iterdir()) == [newest.name, "2026-11-27T03-30-00.000"]
    delete_oldest_recordings(tmp_path, 0, newest)
    assert [each.name for each in tmp_path.iterdir()] == [newest.name]


@pytest.mark.parametrize("inside", ["image0000001.png", "own", "recording.jsonl"])
def test_a_dangling_link_in_the_oldest_recording_ends_no_limit(inside, tmp_path):
    for name in NAMES:
        make_recording(tmp_path / name)
    link = tmp_path / NAMES[0] / inside
    link.unlink(missing_ok=True)
    link.symlink_to("nowhere")
    assert delete_oldest_recordings(tmp_path, 2000) == []
    assert names(tmp_path) == NAMES[1:]


def test_what_links_lead_to_neither_counts_nor_is_deleted(tmp_path):
    kept, others = tmp_path / "kept", make_recording(tmp_path / "others", 50_000)
    for name in NAMES[1:]:
        make_recording(kept / name)
    (kept / NAMES[1] / "image0000001.png").symlink_to(others / "image0000000.png")
    (kept / NAMES[1] / "more").symlink_to(others)
    (kept / NAMES[0]).symlink_to(others)
    before = contents(others)
    delete_oldest_recordings(kept, 2500)
    assert names(kept) == NAMES
    delete_oldest_recordings(kept, 1500)
    assert names(kept) == [NAMES[0], NAMES[2]]
    assert contents(others) == before


def test_folders_that_no_recorder_has_named_stay(tmp_path):
    for name in NAMES:
        make_recording(tmp_path / name)
    (tmp_path / NAMES[0]).rename(tmp_path / "2025 final, first goal")
    make_recording(tmp_path / "0 own data")
    (tmp_path / "2025-01-01T00-00-00.000").mkdir()
    (tmp_path / "2025-01-01T00-00-00.000" / "own.txt").touch()
    delete_oldest_recordings(tmp_path, 0)
    assert names(tmp_path) == ["0 own data", "2025 final, first goal", "2025-01-01T00-00-00.000", NAMES[2]]


def test_a_part_that_can_not_be_deleted_is_told_and_the_next_ones_are_deleted(tmp_path):
    for name in NAMES:
        make_recording(tmp_path / name)
    (tmp_path / NAMES[0] / "private").mkdir()
    (tmp_path / NAMES[0] / "private" / "file").touch()
    (tmp_path / NAMES[0] / "private").chmod(0)
    code = (
        "import sys; from pathlib import Path; from vm_embedded.output.recordings import delete_oldest_recordings\n"
        "print(*(each.name for each in delete_oldest_recordings(Path(sys.argv[1]), 0)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=heed_permissions,
    )
    (tmp_path / NAMES[0] / "private").chmod(0o700)
    assert (done.stdout, done.stderr) == (f"{NAMES[0]}\n", "")
    assert names(tmp_path) == [NAMES[0], NAMES[2]]
    assert names(tmp_path / NAMES[0]) == ["private"]


def test_files_and_recordings_that_vanish_meanwhile_end_no_limit(tmp_path):
    """As if two detectors had the same folder."""
    ended = threading.Event()

    def come_and_go():
        while not ended.is_set():
            make_recording(tmp_path / NAMES[0])
            (tmp_path / NAMES[1] / "image0000009.png").touch()
            (tmp_path / NAMES[1] / "image0000009.png").unlink()
            shutil.rmtree(tmp_path / NAMES[0])

    for name in NAMES[1:]:
        make_recording(tmp_path / name)
    other = threading.Thread(target=come_and_go)
    other.start()
    try:
        for _ in range(1000):
            delete_oldest_recordings(tmp_path, 1e9)
    finally:
        ended.set()
        other.join()
    assert names(tmp_path) == NAMES[1:]


def test_a_left_recording_without_frames_is_removed_unless_it_has_something_else(tmp_path):
    for name in NAMES:
        (tmp_path / f"{name}.part").mkdir()
        for own in ("vm.toml", "model.onnx", "recording.jsonl", "image0000000.jpg"):
            (tmp_path / f"{name}.part" / own).touch()
    (tmp_path / f"{NAMES[1]}.part" / "notes.txt").write_text("mine")
    (tmp_path / f"{NAMES[2]}.part" / "lens0000000.yaml").symlink_to(tmp_path)
    before = contents(tmp_path / f"{NAMES[1]}.part")
    found = dict(finish_left_recordings(tmp_path))
    assert found.pop(tmp_path / NAMES[0]) == 0
    assert [(path.stem, type(error)) for path, error in found.items()] == [(name, OSError) for name in NAMES[1:]]
    assert names(tmp_path) == [f"{name}.part" for name in NAMES[1:]]
    assert contents(tmp_path / f"{NAMES[1]}.part") == before


def test_a_left_recording_never_replaces_another(tmp_path):
    for name in (NAMES[0], f"{NAMES[0]}.part", f"{NAMES[1]}.part"):
        make_recording(tmp_path / name)
    (tmp_path / NAMES[0] / "recording.jsonl").write_text("other")
    with locked_folder(tmp_path / f"{NAMES[1]}.part"):
        ((path, error),) = finish_left_recordings(tmp_path)
    assert path == tmp_path / f"{NAMES[0]}.part"
    assert isinstance(error, OSError)
    assert (tmp_path / NAMES[0] / "recording.jsonl").read_text() == "other"
    assert dict(finish_left_recordings(tmp_path)).pop(tmp_path / NAMES[1]) == 1


@pytest.mark.long
def test_a_detector_deletes_old_recordings_with_dangling_links_and_reports_the_new_one_as_complete(tmp_path):
    kept = tmp_path / "recordings"
    for name in NAMES:
        make_recording(kept / name, 2**26)
        (kept / name / "image0000001.png").symlink_to("nowhere")
    options = ("--camera", "synthetic", "--recorder-folder", kept, "--recorder-disk-mib", 100)
    with running(tmp_path, *options, "--recorder-trigger-class", "ball") as found:
        found.wait(lambda: names(kept)[0] == NAMES[2])
        found.wait(lambda: [each for each in found.events if "recorded" in each["event"]])
        os.truncate(kept / NAMES[2] / "image0000000.png", 2**27)
        found.process.send_signal(signal.SIGUSR1)
        found.wait(lambda: len([each for each in found.events if "recorded" in each["event"]]) == 2)
        found.stop()
    told = [each for each in found.events if each["event"] in ("recorded", "recording failed", "not deleted")]
    assert [(each["event"], each["level"]) for each in told] == [("recorded", "info")] * 2
    assert len(names(kept)) == 2
    assert NAMES[2] not in names(kept)


@pytest.mark.long
def test_a_detector_that_starts_takes_no_recording_for_a_left_one(tmp_path):
    """It looks for left recordings while another one begins some in the same folder."""
    done = threading.Event()

    def start_often():
        while not done.is_set():
            for _ in finish_left_recordings(tmp_path):
                pass

    starting = [threading.Thread(target=start_often) for _ in range(2)]
    for each in starting:
        each.start()
    try:
        for _ in range(500):
            part, lock = begin_recording(tmp_path)
            with lock:
                (part / "recording.jsonl").write_bytes(b"{}\n")
                path = finish(part, 1)
            assert (path / "recording.jsonl").read_bytes() == b"{}\n"
            shutil.rmtree(path)
    finally:
        done.set()
        for each in starting:
            each.join()
    assert not names(tmp_path)
