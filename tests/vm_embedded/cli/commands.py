"""Running vm-detect as a user does: real processes, whose output is read back."""

import json
from functools import partial

from tests.drawn_scenes import MODEL
from tests.messages import checked
from tests.programs import BIN, run_program

COMMAND = BIN / "vm-detect"
run = partial(run_program, COMMAND)


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
