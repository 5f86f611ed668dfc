"""The entry points of all programs: each imports its program only when it runs, and Ctrl-C ends it quietly meanwhile.

The imports of a program take up to a second. Python would print a traceback for an interrupt during them, so this
package itself imports nothing of the project.
"""

import signal
from importlib import import_module


def _run(program: str) -> int:
    """Import the module of a program, and run its `main`. Meanwhile, Ctrl-C ends the process at once."""
    handler = signal.getsignal(signal.SIGINT)
    if handler is signal.default_int_handler:  # not in the background of a shell script, where SIGINT is ignored
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    module = import_module(program)
    signal.signal(signal.SIGINT, handler)
    status: int = module.main()
    return status


def detect() -> int:
    """vm-detect."""
    return _run("vm_embedded.cli.detect")


def doctor() -> int:
    """vm-doctor."""
    return _run("vm_embedded.cli.doctor")


def bench() -> int:
    """vm-bench."""
    return _run("vm_embedded.cli.bench")


def export() -> int:
    """vm-export."""
    return _run("vm_export.cli")


def synth() -> int:
    """vm-synth."""
    return _run("vm_synth.cli")


def train() -> int:
    """vm-train."""
    return _run("vm_train.cli.train")


def evaluate() -> int:
    """vm-evaluate."""
    return _run("vm_train.cli.evaluate")


def mesh() -> int:
    """vm-mesh."""
    return _run("vm_mesh.cli")


def label() -> int:
    """vm-label."""
    return _run("vm_label.cli")


def calibrate() -> int:
    """vm-calibrate."""
    return _run("vm_calibrate.cli")


def ros() -> int:
    """vm-ros."""
    return _run("vm_ros.cli")
