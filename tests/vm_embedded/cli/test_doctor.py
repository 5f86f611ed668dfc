"""vm-doctor as a user types it."""

import json
import sys
from pathlib import Path

import pytest

from tests.preloaded import run_preloaded

COMMAND = Path(sys.executable).parent / "vm-doctor"


def test_the_command_prints_findings_and_fails_if_one_is_in_the_way(tmp_path):
    command = [COMMAND, "--json", "--status-socket", tmp_path / "socket", "--camera", "synthetic"]
    done = run_preloaded(command)
    assert done.returncode == 0, done.stdout
    findings = [json.loads(line) for line in done.stdout.splitlines()]
    assert {"processor", "threads", "model", "camera", "clock"} <= {each["about"] for each in findings}
    done = run_preloaded([*command, "--camera", "/dev/none"])
    assert done.returncode == 1


@pytest.mark.long
def test_the_command_searches_the_frames_of_the_user(tmp_path):
    demo = Path(__file__).parents[2] / "fixtures" / "demo"
    done = run_preloaded([COMMAND, "--json", "--status-socket", tmp_path / "socket", "--camera", demo])
    findings = {each["about"]: each for each in map(json.loads, done.stdout.splitlines())}
    seen = findings["detection"]
    assert (done.returncode, seen["state"]) == (0, "ok"), seen
    assert all(word in seen["seen"] for word in ("5 frames", "points", "proposals", "ball")), seen
