"""The installed programs in processes of their own, whose output is read back."""

import ctypes
import resource
import signal
import subprocess
import sys
from pathlib import Path

from .preloaded import LEARNING, RUNTIME, run_preloaded

BIN = Path(sys.executable).parent


def run_program(name, *arguments, code=0, preexec_fn=None, **more):
    """Run a program and check its exit status. `more` is what run_preloaded takes."""
    command = [str(BIN / name), *map(str, arguments)]
    if preexec_fn:
        done = subprocess.run(command, capture_output=True, text=True, preexec_fn=preexec_fn, **more)
    else:
        done = run_preloaded(command, LEARNING if Path(name).name in ("vm-evaluate", "vm-export") else RUNTIME, **more)
    assert done.returncode == code, (done.returncode, done.stderr)
    assert "Traceback" not in done.stderr
    return done


def run_main(main, capsys, *arguments, code=0):
    """What a program's main prints: standard output, or standard error if it fails."""
    assert main([str(each) for each in arguments]) == code
    done = capsys.readouterr()
    assert "Traceback" not in done.err
    return done.err if code else done.out


def heed_interrupts():
    """Stop at SIGINT, which a shell's background jobs and their children ignore; for `preexec_fn`."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def limit_files(size):
    """Let writes beyond a size of a file [bytes] fail, as on a full disk; for `preexec_fn`."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def heed_permissions():
    """Take from a program of root the right to read and write all files; for `preexec_fn`."""
    drop_from_bounding_set, override, read_search = 24, 1, 2
    for capability in (override, read_search):
        ctypes.CDLL(None).prctl(drop_from_bounding_set, capability, 0, 0, 0)
