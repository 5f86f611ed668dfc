"""Programs with worker processes on a system without shared memory."""

import subprocess

import pytest

from tests.programs import BIN
from tests.vm_embedded.live.running import DEMO

READ_ONLY = "mount -t tmpfs -o ro none /dev/shm"
HIDDEN = "mount -t tmpfs -o size=64k none /dev && mknod -m 666 /dev/null c 1 3 && mknod -m 666 /dev/urandom c 1 9"


def without_shared_memory(how, *command):
    """Run a command in a mount namespace of its own, in which /dev/shm is read-only or missing."""
    script = f'{how} || exit 99; exec "$@"'
    return subprocess.run(
        ["unshare", "-m", "sh", "-c", script, "sh", *map(str, command)], capture_output=True, text=True
    )


@pytest.fixture(params=[READ_ONLY, HIDDEN], ids=["read-only", "missing"])
def how(request):
    if without_shared_memory(request.param, "true").returncode:
        pytest.skip("this user may not mount another /dev/shm")
    return request.param


@pytest.mark.long
@pytest.mark.parametrize(
    ("program", "options"),
    [
        ("vm-train", (DEMO, "-o", "{}", "--workers", 2)),
        ("vm-train", ("look", DEMO, "--from", "ball", "-o", "{}", "--workers", 2)),
        ("vm-synth", ("{}", "--count", 1)),
    ],
    ids=["train", "look", "synth"],
)
def test_missing_shared_memory_is_one_line_before_a_folder_is_made(tmp_path, how, program, options):
    out = tmp_path / "out"
    done = without_shared_memory(how, BIN / program, *(out if each == "{}" else each for each in options))
    assert done.returncode == 1, done
    (line,) = done.stderr.splitlines()
    assert "/dev/shm" in line
    assert line.startswith(program)
    assert not out.exists()


def test_one_process_needs_no_shared_memory(how):
    done = without_shared_memory(how, BIN / "vm-train", "check", DEMO, "--workers", 1)
    assert "/dev/shm" not in done.stderr
    assert "Traceback" not in done.stderr
