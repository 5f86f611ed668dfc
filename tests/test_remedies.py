"""The commands that programs advise when a package is missing, run as a user runs them."""

import os
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

TOP = Path(__file__).parents[1]
EXTRAS = tomllib.loads((TOP / "pyproject.toml").read_text())["project"]["optional-dependencies"]

OTHERS = (
    "torch",
    "onnx",
    "PIL",
    "yaml",
    "matplotlib",
    "tensorboard",
    "google",
    "google_crc32c",
    "scipy",
    "mitsuba",
    "drjit",
    "rosbags",
    "cyclonedds",
)
"""Modules that pip install . does not bring."""

CALLS = [
    ("vm_train.cli.train", "torch", ["data", "-o", "run"]),
    ("vm_train.cli.train", "google", ["import", "a.tfrecord", "out"]),
    ("vm_train.cli.evaluate", "matplotlib", ["ball", str(TOP / "tests" / "fixtures" / "demo"), "-o", "report"]),
    ("vm_export.cli", "torch", ["model.pt"]),
    ("vm_synth.cli", "mitsuba", ["out", "--count", "1", "--hdri", "."]),
    ("vm_mesh.cli", "matplotlib", ["quality", "-o", "quality.svg"]),
    ("vm_embedded.cli.detect", "rosbags", ["recording.mcap"]),
    ("vm_embedded.cli.detect", "rosbags", ["map.hdr", "--save-mcap", "out.mcap"]),
    ("vm_ros.cli", "cyclonedds", []),
]

STATUS = {"vm_ros.cli": 78}
"""Exit status of a program that a service manager starts; that of the others is 1."""


def without_extras(module: str, arguments: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a program as on a machine that has only the runtime."""
    nothing = f"import sys; sys.modules.update(dict.fromkeys({OTHERS}))"
    program = f"{nothing}; from {module} import main; sys.exit(main({arguments}))"
    path = os.pathsep.join([str(TOP), str(TOP / "export")])
    environment = {**os.environ, "PYTHONPATH": path}
    command = [sys.executable, "-c", program]
    captured = {"capture_output": True, "text": True}
    return subprocess.run(command, cwd=folder, env=environment, check=False, timeout=120, **captured)


@pytest.fixture(scope="module")
def install(tmp_path_factory):
    """Runs a command of pip in a copy of the checkout, once. It builds this project, but downloads nothing."""
    folder = tmp_path_factory.mktemp("checkout")
    for each in ("pyproject.toml", "README.md", "LICENSE", "vm_embedded", "export"):
        (folder / each).symlink_to(TOP / each)

    @cache
    def installed(command):
        offline = command.replace("pip", f"{sys.executable} -m pip", 1)
        return subprocess.run(offline, shell=True, cwd=folder, capture_output=True, text=True, check=False, timeout=300)

    return installed


@pytest.mark.long
@pytest.mark.parametrize(("module", "package", "arguments"), CALLS, ids=[f"{each[0]}-{each[1]}" for each in CALLS])
def test_a_program_without_its_packages_advises_a_command_that_installs_them(
    module, package, arguments, tmp_path, install
):
    cv2.imwrite(str(tmp_path / "map.hdr"), np.ones((64, 128, 3), np.float32))  # for vm-synth
    done = without_extras(module, arguments, tmp_path)
    assert done.returncode == STATUS.get(module, 1)
    assert "Traceback" not in done.stderr
    (advice,) = re.findall(r"run: (pip install '\.\[(\w+)\]') in the folder of vm-embedded", done.stderr)
    command, extra = advice
    assert package in requirements(extra)
    tried = install(f"{command} --dry-run --no-deps --no-build-isolation")
    assert tried.returncode == 0, tried.stderr
    assert "Would install vm-embedded" in tried.stdout


@pytest.mark.long
def test_the_install_commands_of_the_pages_work(install):
    """With their extras, from the checkout and from the wheel that a release makes."""
    pages = [TOP / "README.md", TOP / "docs" / "use.md"]
    found = re.findall(r"(pip install (?:\.|'[^']*'))", "".join(page.read_text() for page in pages))
    assert {"pip install .", "pip install '.[train]'", "pip install '.[synth,train]'"} < set(found)
    assert any("dist/" in each and "[train]" in each for each in found)
    built = install("pip wheel . --wheel-dir dist --no-deps --no-build-isolation")
    assert built.returncode == 0, built.stderr
    for command in set(found):
        tried = install(f"{command} --dry-run --no-deps --no-build-isolation --force-reinstall")
        assert tried.returncode == 0, tried.stderr
        assert "Would install vm-embedded" in tried.stdout
        assert "does not provide the extra" not in tried.stderr


def requirements(extra: str) -> str:
    """The packages of an extra and of those that it includes."""
    included = re.findall(r"vm-embedded\[(\w+)\]", " ".join(EXTRAS[extra]))
    return " ".join([*EXTRAS[extra], *map(requirements, included)])


def test_no_page_and_no_program_names_a_package_that_is_not_published():
    texts = [*TOP.glob("*.md"), *(TOP / "docs").glob("*.md"), *(TOP / "deploy").glob("*.md")]
    texts += [*(TOP / "vm_embedded").rglob("*.py"), *(TOP / "export").rglob("*.py")]
    assert len(texts) > 100
    assert [str(each) for each in texts if re.search(r"pip install '?vm-embedded", each.read_text())] == []
