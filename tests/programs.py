"""The installed programs as a user starts them: real processes, whose output is read back."""

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
