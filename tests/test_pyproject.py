"""What the distribution declares."""

import tomllib
from pathlib import Path


def test_package_data_and_scripts_are_declared():
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
    assert set(project["scripts"]) == {
        "vm-detect",
        "vm-doctor",
        "vm-export",
        "vm-bench",
        "vm-synth",
        "vm-train",
        "vm-evaluate",
        "vm-mesh",
        "vm-label",
        "vm-calibrate",
        "vm-ros",
    }
    assert [each.split(">")[0] for each in project["dependencies"]] == [
        "numpy",
        "onnxruntime",
        "opencv-python-headless",
        "tomli",
    ]
    assert project["dependencies"][-1].endswith("; python_version < '3.11'")
