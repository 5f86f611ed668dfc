import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cli import checks as doctor
from vm_embedded.cli.checks import BAD, GOOD, WARNING
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.radial_lenses import Equisolid
from vm_embedded.live.configuration import Configuration, StatusSettings

COMMAND = Path(sys.executable).parent / "vm-doctor"
MENDED = Configuration(
    camera=CameraSettings(source="synthetic", width=640, height=512),
    lens=LensFile(Equisolid(focal_length=300.0, fov=2.0, size=(1280, 1024)), None),
)


@pytest.fixture
def root(tmp_path):
    """A machine on which everything is right."""
    for name, text in (
        ("proc/cpuinfo", "model name : A\nflags : avx2 fma\nmodel name : A\nflags : avx2 fma avx512f\n"),
        ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n"),
        ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
    (tmp_path / "dev").mkdir()
    return tmp_path


def found(configuration, root):
    return {each.about: each for each in doctor.examine(configuration, root)}


def test_a_machine_without_faults_has_none(root):
    assert {each.state for each in doctor.examine(MENDED, root)} == {GOOD}


def test_a_slow_processor_a_slow_governor_and_a_slow_clock_are_seen(root):
    (root / "proc/cpuinfo").write_text("model name : Old\nflags : sse2\n")
    (root / "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor").write_text("powersave\n")
    (root / "sys/devices/system/clocksource/clocksource0/current_clocksource").write_text("hpet\n")
    seen = found(MENDED, root)
    assert [seen[name].state for name in ("processor", "governor", "clock")] == [WARNING] * 3
    assert "no avx2 and no fma" in seen["processor"].seen
    assert "scaling_governor" in seen["governor"].mend


def test_more_threads_than_cores_are_seen():
    assert doctor.affinity(4, 2, 8).state == WARNING
    assert "--threads 2" in doctor.affinity(4, 2, 8).mend
    assert doctor.affinity(2, 2, 8).state == GOOD


def test_two_wheels_of_opencv_are_seen():
    finding = doctor.wheels({"opencv-python", "opencv-python-headless", "numpy"})
    assert finding.state == BAD
    assert "pip uninstall" in finding.mend


def test_a_wrong_clock_is_seen(tmp_path):
    assert "timedatectl" in doctor.clock(tmp_path / "none", 1e9).mend


def test_a_camera_that_is_not_there_or_may_move_is_seen(root):
    wanted = replace(MENDED, camera=CameraSettings(source="0"))
    assert found(wanted, root)["camera"].state == BAD
    (root / "dev" / "video0").write_text("")
    assert found(wanted, root)["camera"].state == WARNING
    by_id = replace(MENDED, camera=CameraSettings(source="/dev/v4l/by-id/usb-camera"))
    assert found(by_id, root)["camera"].state == BAD


def test_a_camera_that_may_not_be_opened_is_seen(root, monkeypatch):
    (root / "dev" / "video0").write_text("")
    monkeypatch.setattr(os, "access", lambda path, mode: "video" not in str(path))  # root may open everything
    node = found(MENDED, root)[str(root / "dev" / "video0")]
    assert node.state == BAD
    assert "usermod -aG video" in node.mend


def test_a_model_that_is_none_is_seen(root, tmp_path):
    (tmp_path / "model.onnx").write_text("no model")
    assert found(replace(MENDED, model=str(tmp_path / "model.onnx")), root)["model"].state == BAD


def test_a_lens_for_another_size_is_seen(root):
    other = replace(MENDED, camera=CameraSettings(source="synthetic", width=640, height=480))
    assert found(other, root)["lens"].state == BAD
    assert "other proportions" in found(other, root)["lens"].seen
    assert found(replace(MENDED, lens=None), root)["lens"].state == WARNING


def test_a_status_socket_without_a_folder_is_seen(root):
    nowhere = replace(MENDED, status=StatusSettings(socket="/nowhere/at/all"))
    assert found(nowhere, root)["status socket"].state == BAD


def test_every_fault_has_a_command_that_mends_it(root):
    broken = Configuration(camera=CameraSettings(source="9"), status=StatusSettings(socket="/nowhere/at/all"))
    for each in doctor.examine(broken, root):
        assert each.state == GOOD or each.mend, each


def test_the_command_prints_findings_and_fails_if_one_is_in_the_way(tmp_path):
    command = [COMMAND, "--json", "--status-socket", tmp_path / "socket", "--camera", "synthetic"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout
    findings = [json.loads(line) for line in done.stdout.splitlines()]
    assert {"processor", "threads", "model", "camera", "clock"} <= {each["about"] for each in findings}
    done = subprocess.run([*command, "--camera", "/dev/none"], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
