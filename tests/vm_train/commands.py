"""vm-train in a process of its own, and a configuration for which seconds are enough."""

import os
import subprocess
import sys

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
    done = subprocess.run(
        [sys.executable, "-m", module, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=240,
        env=environment(),
    )
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done
