"""Standard error while an image is decoded: nothing waits for its reader, and the log does not go through it."""

import os
import subprocess
import sys
from contextlib import suppress

import pytest

OF_ANOTHER_THREAD = """
import os
from vm_embedded.cameras.library_messages import library_messages
with library_messages():
    os.write(2, b"a line of another thread\\n" * 1000)
print("done")
"""

LOGGED = """
from vm_embedded.cameras.library_messages import library_messages
from vm_embedded.live.log import EventLog
log = EventLog()
with library_messages():
    log("logged")
    print("decoded", flush=True)
"""


@pytest.mark.parametrize("reader", ["sleeps", "has left"])
def test_lines_for_a_pipe_that_nobody_reads_are_lost(reader):
    reading, writing = os.pipe()
    if reader == "has left":
        os.close(reading)
    else:
        os.set_blocking(writing, False)
        with suppress(BlockingIOError):
            while True:
                os.write(writing, bytes(4096))
        os.set_blocking(writing, True)
    with os.fdopen(writing, "wb") as stderr:
        command = [sys.executable, "-c", OF_ANOTHER_THREAD]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=stderr, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (0, b"done\n")
    if reader == "sleeps":
        os.close(reading)


def test_the_log_does_not_wait_for_the_decoder():
    command = [sys.executable, "-c", LOGGED]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60, check=True)
    assert ["logged" in line for line in done.stdout.splitlines()] == [True, False], done.stdout
