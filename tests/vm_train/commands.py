"""vm-train in a process of its own, and a configuration for which seconds are enough."""

import os
import signal
import subprocess
import sys
import time

from tests.preloaded import LEARNING, run_preloaded
from tests.programs import heed_interrupts

COMMAND = [sys.executable, "-m", "vm_train"]
SMALL = """
[mesh]
radius = 0.07
max_distance = 4.0
[network]
depth = 3
width = 4
[training]
epochs = 3
batch = 4
selection = "hard"
rounds = 2
"""


def environment():
    return {**os.environ, "CUDA_VISIBLE_DEVICES": ""}


def run(*arguments, code=0):
    """Run vm-train and check its exit status."""
    return run_module("vm_train", *arguments, code=code)


def run_module(module, *arguments, code=0):
    """Run python -m MODULE and check its exit status."""
    done = run_preloaded(["-m", module, *arguments], LEARNING, env=environment())
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done


def run_and_stop(how, folder, file, steps, *arguments):
    """Run vm-train to a folder, send it a signal once a file in the folder has so many losses, and check its end."""
    process = subprocess.Popen(
        [*COMMAND, *map(str, arguments), "-o", str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
        start_new_session=True,
        preexec_fn=heed_interrupts,
    )
    wait_for_steps(folder / file, steps, process)
    process.send_signal(how)
    error = process.communicate(timeout=60)[1]
    assert process.returncode == (-signal.SIGKILL if how == signal.SIGKILL else 130)
    assert "Traceback" not in error
    if how != signal.SIGKILL:
        assert error.endswith(f"vm-train: stopped; continue with vm-train resume {folder}\n")


def wait_for_steps(path, count, process):
    """Wait until a file is there and has so many losses of a running training."""
    deadline = time.monotonic() + 120
    while not path.exists() or (count and path.read_text().count('"loss"') < count):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.005)
