"""vm-doctor as a user types it."""

import json
import subprocess
import sys
from pathlib import Path

from tests.drawn_scenes import FOLDER

COMMAND = Path(sys.executable).parent / "vm-doctor"


def test_the_command_prints_findings_and_fails_if_one_is_in_the_way(tmp_path):
    command = [COMMAND, "--json", "--status-socket", tmp_path / "socket", "--camera", "synthetic"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout
    findings = [json.loads(line) for line in done.stdout.splitlines()]
    assert {"processor", "threads", "model", "camera", "clock"} <= {each["about"] for each in findings}
    done = subprocess.run([*command, "--camera", "/dev/none"], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1


def test_a_folder_whose_pictures_have_lens_files_needs_no_other_lens_and_pose(tmp_path):
    command = [COMMAND, "--json", "--status-socket", tmp_path / "socket", "--camera", FOLDER]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout
    states = {each["about"]: each["state"] for each in map(json.loads, done.stdout.splitlines())}
    assert (states["lens"], states["pose"]) == ("ok", "ok")
