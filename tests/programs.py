"""The installed programs as a user starts them: real processes, whose output is read back."""

import ctypes
import resource
import subprocess
import sys
from pathlib import Path

BIN = Path(sys.executable).parent


def run_program(name, *arguments, code=0, **more):
    """Run a program and check its exit status."""
    done = subprocess.run([str(BIN / name), *map(str, arguments)], capture_output=True, text=True, **more)
    assert done.returncode == code, (done.returncode, done.stderr)
    assert "Traceback" not in done.stderr
    return done


def limit_files(size):
    """Let writes beyond a size of a file [bytes] fail, as on a full disk; for `preexec_fn`."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def heed_permissions():
    """Take from a program of root the right to read and write all files; for `preexec_fn`."""
    drop_from_bounding_set, override, read_search = 24, 1, 2
    for capability in (override, read_search):
        ctypes.CDLL(None).prctl(drop_from_bounding_set, capability, 0, 0, 0)
