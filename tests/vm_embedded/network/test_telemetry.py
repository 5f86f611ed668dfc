"""ONNX Runtime's official builds report to their makers; a robot's must not."""

import os
import subprocess
import sys


def test_nothing_is_kept_to_be_reported(tmp_path):
    """An identifier and a queue of reports appear in the home of a process that is not told otherwise."""
    program = "from vm_embedded import Detector; Detector.from_file('ball')"
    quiet = {"CI", "ORT_DISABLE_TELEMETRY"} | {each for each in os.environ if each.startswith(("XDG_", "GITHUB_"))}
    environment = {name: value for name, value in os.environ.items() if name not in quiet and "PYTEST" not in name}
    subprocess.run([sys.executable, "-c", program], env=environment | {"HOME": str(tmp_path)}, check=True)
    assert list(tmp_path.rglob("*")) == []
