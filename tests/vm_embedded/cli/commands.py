"""Running vm-detect as a user does: real processes, whose output is read back."""

import json
import subprocess
import sys
from pathlib import Path

from tests.drawn_scenes import MODEL
from tests.messages import checked

COMMAND = Path(sys.executable).parent / "vm-detect"


def run(*arguments, code=0, **more):
    done = subprocess.run([str(COMMAND), *map(str, arguments)], capture_output=True, text=True, **more)
    assert done.returncode == code, (done.returncode, done.stderr)
    assert "Traceback" not in done.stderr
    return done


def detect(source, *options, **more):
    return run("--camera", source, "--model", MODEL, *options, **more)


def lines(done):
    def no_constant(name):
        raise AssertionError(f"{name} is no JSON")

    return [checked(json.loads(line, parse_constant=no_constant)) for line in done.stdout.splitlines()]


def one_complaint(done, *parts):
    (complaint,) = done.stderr.splitlines()
    for part in parts:
        assert part in complaint
    return done
