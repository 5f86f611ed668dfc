"""make bundle: what is in it, that it is always the same, and what it refuses."""

import configparser
import hashlib
import json
import os
import subprocess
import tomllib
from zipfile import ZipFile

import pytest

import vm_embedded

from .bundles import CHECKOUT, bundle_command, need_wheels, unpacked

LARGEST_BUNDLE = 99 * 2**20
"""[bytes]"""

LARGEST_RUNTIME = 1_000_000
"""Of the robot's wheel of this project, which has no network [bytes]."""


def test_everything_a_robot_needs_is_in_it_and_nothing_else(bundle, bundle_file):
    names = {str(each.relative_to(bundle)) for each in bundle.rglob("*") if each.is_file()}
    wheels = {each.split("/")[1].split("-")[0] for each in names if each.startswith("wheels/")}
    assert wheels == {"vm_embedded", "installer", "numpy", "onnxruntime", "opencv_python_headless"}
    assert {each for each in names if not each.startswith("wheels/")} == {
        *(
            "SHA256SUMS",
            "manifest.json",
            "README.md",
            "releases.sh",
            "verify.sh",
            "60-vm-embedded.rules",
        ),
        *("install.sh", "uninstall.sh", "vm-deploy", "vm-detect.service", "vm-detect-rollback.service"),
        *("etc/vm.toml", "etc/model.onnx"),
    }
    assert bundle_file.name == f"vm-embedded-robot-{vm_embedded.__version__}-linux_x86_64-cp311.tar.gz"
    release = json.loads((bundle / "manifest.json").read_text())["release"]
    assert bundle.name == f"vm-embedded-robot-{release}-linux_x86_64-cp311"
    assert bundle_file.stat().st_size < LARGEST_BUNDLE


def test_the_runtime_is_small_and_has_only_what_runs_on_robots(bundle):
    (own,) = bundle.glob("wheels/vm_embedded-*.whl")
    assert own.stat().st_size < LARGEST_RUNTIME
    with ZipFile(own) as wheel:
        names = [each for each in wheel.namelist() if ".dist-info/" not in each]
        (listed,) = (each for each in wheel.namelist() if each.endswith("/entry_points.txt"))
        programs = configparser.ConfigParser()
        programs.read_string(wheel.read(listed).decode())
    assert {each.split("/")[0] for each in names} == {"vm_embedded", "vm_ros", "vm_programs"}
    assert not [each for each in names if each.endswith(".onnx")]
    assert set(programs["console_scripts"]) == {"vm-detect", "vm-doctor", "vm-bench", "vm-ros"}


def test_its_sums_and_hashes_are_true(bundle):
    assert subprocess.run(["sha256sum", "--check", "--strict", "--quiet", "SHA256SUMS"], cwd=bundle).returncode == 0
    listed = {line.split()[1] for line in (bundle / "SHA256SUMS").read_text().splitlines()}
    assert listed | {"SHA256SUMS"} == {str(each.relative_to(bundle)) for each in bundle.rglob("*") if each.is_file()}
    locked = (CHECKOUT / "deploy" / "robot.txt").read_text()
    for wheel in bundle.glob("wheels/*.whl"):
        assert wheel.name.startswith("vm_embedded") or hashlib.sha256(wheel.read_bytes()).hexdigest() in locked


def test_its_manifest_says_what_it_is(bundle):
    manifest = json.loads((bundle / "manifest.json").read_text())
    commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=CHECKOUT, capture_output=True, text=True).stdout.strip()
    assert manifest["commit"].removesuffix("+changes") == commit
    assert manifest["release"].startswith(f"{vm_embedded.__version__}-")
    assert manifest["packages"]["numpy"][0].isdigit()
    assert manifest["model_sha256"] == hashlib.sha256((bundle / "etc/model.onnx").read_bytes()).hexdigest()


@pytest.mark.long
def test_twice_gives_the_same_bytes(bundle_file, tmp_path):
    before = os.umask(0o077)
    try:
        elsewhere = os.environ | {"TMPDIR": str(tmp_path), "TZ": "Asia/Tokyo", "PYTHONHASHSEED": "7", "LC_ALL": "C"}
        ran = bundle_command("--dist", tmp_path / "dist", cwd=tmp_path, env=elsewhere)
    finally:
        os.umask(before)
    assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "dist" / bundle_file.name).read_bytes() == bundle_file.read_bytes()


@pytest.mark.long
def test_a_configuration_brings_its_model_and_its_lens(tmp_path):
    need_wheels()
    lens = '[lens]\nprojection = "equisolid"\nfocal_length = 420.0\nfov = 3.14\n'
    (tmp_path / "left.toml").write_text(lens)
    text = '# ours\nmodel = "ball"\nlens = "left.toml" # of the left eye\n\n[camera]\nsource = "0"\n'
    (tmp_path / "robot.toml").write_text(text)
    ran = bundle_command("--dist", tmp_path / "dist", "--config", tmp_path / "robot.toml")
    assert (ran.returncode, ran.stderr) == (0, "")
    (path,) = (tmp_path / "dist").iterdir()
    etc = unpacked(path, tmp_path / "unpacked") / "etc"
    table = tomllib.loads((etc / "vm.toml").read_text())
    assert table == {"model": "model.onnx", "lens": "left.toml", "camera": {"source": "0"}}
    assert (etc / "vm.toml").read_text().startswith("# ours\n")
    assert (etc / "left.toml").read_text() == lens
    package = CHECKOUT / "vm_embedded" / "models"
    assert (etc / "model.onnx").read_bytes() == (package / "ball.onnx").read_bytes()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--target", "windows"], ["TARGET", "linux_x86_64-cp311", "'windows'"]),
        (["--target", "linux_x86_64-cp39"], ["TARGET", "Python 3.11 or newer"]),
        (["--model", "socker"], ["'socker'", "did you mean 'soccer'"]),
        (["--model", "missing.onnx"], ["missing.onnx"]),
        (["--config", "missing.toml"], ["missing.toml"]),
    ],
)
def test_what_is_wrong_is_said(tmp_path, options, words):
    ran = bundle_command("--dist", tmp_path, *options)
    assert ran.returncode == 1
    assert "Traceback" not in ran.stderr
    for word in words:
        assert word in ran.stderr, ran.stderr
    assert not list(tmp_path.iterdir())


def test_a_lens_does_not_take_the_place_of_the_configuration(tmp_path):
    (tmp_path / "lenses").mkdir()
    (tmp_path / "lenses" / "vm.toml").write_text('projection = "rectilinear"\nfocal_length = 420.0\nfov = 2.0\n')
    (tmp_path / "robot.toml").write_text('lens = "lenses/vm.toml"\n', encoding="utf-8-sig")
    ran = bundle_command("--dist", tmp_path / "dist", "--config", tmp_path / "robot.toml")
    assert ran.returncode == 1
    assert "can't be called vm.toml" in ran.stderr
    assert "[camera] source" in ran.stderr  # it names no camera, either


def test_a_configuration_with_an_unknown_entry_is_refused(tmp_path):
    (tmp_path / "robot.toml").write_text('[camera]\nsorce = "0"\n')
    ran = bundle_command("--dist", tmp_path / "dist", "--config", tmp_path / "robot.toml")
    assert ran.returncode == 1
    assert "sorce" in ran.stderr
    assert "source" in ran.stderr
