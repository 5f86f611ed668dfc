"""vm-calibrate kalibr on files as Kalibr writes them."""

import numpy as np
import pytest

from vm_embedded.geometry.calibrated_lenses import BrownLens, FisheyeLens
from vm_embedded.geometry.lens_files import read_lens_file

from .films import run

CAMCHAIN = """\
cam0:
  T_cam_imu:
  - [0.01, -0.99, 0.02, 0.1]
  - [0.99, 0.01, 0.03, 0.2]
  - [-0.03, 0.02, 0.99, 0.3]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.8e-05]
  distortion_model: radtan
  intrinsics: [458.6, 457.3, 367.2, 248.4]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.001
cam1:
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [-0.01, 0.02, -0.012, 0.004]
  distortion_model: equidistant
  intrinsics: [460.0, 461.0, 365.0, 247.0]
  resolution: [752, 480]
  rostopic: /cam1/image_raw
"""


@pytest.fixture
def convert(tmp_path, capsys):
    """Converts a text, and returns the lens and what was printed, or the error."""

    def convert(text, *arguments, code=0):
        (tmp_path / "camchain.yaml").write_text(text)
        output = tmp_path / "lens.yaml"
        printed = run(capsys, "kalibr", tmp_path / "camchain.yaml", *arguments, "-o", output, code=code)
        return (read_lens_file(output).lens, printed) if code == 0 else printed

    return convert


def test_radtan_is_a_pinhole_lens(convert):
    lens, printed = convert(CAMCHAIN, "--camera", "cam0")
    assert isinstance(lens, BrownLens)
    assert lens.focal_lengths == (458.6, 457.3)
    assert lens.optical_center == (367.2, 248.4)
    assert lens.coefficients == (-0.28, 0.07, 0.0002, 1.8e-05)
    assert lens.size == (752, 480)
    assert "cam0 of camchain.yaml" in printed


def test_equidistant_is_a_fisheye_lens(convert):
    lens, _ = convert(CAMCHAIN, "--camera", "cam1")
    assert isinstance(lens, FisheyeLens)
    assert lens.coefficients == (-0.01, 0.02, -0.012, 0.004)
    ray = np.array([[1.0, 0.0, 0.0]])
    assert lens.project(ray, (752, 480))[0] == pytest.approx((365.0, 247.0))


def test_a_file_of_one_camera_needs_no_name(convert):
    one = CAMCHAIN.split("cam1:")[0]
    assert convert(one)[0] == convert(CAMCHAIN, "--camera", "cam0")[0]
    assert convert("\ufeff" + one)[0] == convert(one)[0]  # as some editors of Windows begin a file
    without_name = "\n".join(line.removeprefix("  ") for line in one.splitlines()[6:])
    assert convert(without_name)[0] == convert(one)[0]


def test_no_distortion_is_a_plain_pinhole(convert):
    text = CAMCHAIN.split("cam1:")[0].replace("radtan", "none").replace("[-0.28, 0.07, 0.0002, 1.8e-05]", "[]")
    assert convert(text)[0].coefficients == ()


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("", "", "has 2 cameras; choose one with --camera (cam0, cam1)"),
        ("cam1", "cam0", "line 15: duplicate key"),
        (
            "radtan",
            "fov",
            "distortion model fov has no lens in vm-detect; calibrate again with Kalibr's `pinhole-equi`",
        ),
        ("radtan", "radtam", "unknown distortion model 'radtam'; did you mean 'radtan'?"),
        ("model: pinhole", "model: omni", "camera model omni (Mei's omnidirectional model) has no lens in vm-detect"),
        ("model: pinhole", "model: pinhol", "unknown camera model 'pinhol'"),
        ("[458.6, 457.3, 367.2, 248.4]", "[458.6, 457.3]", "intrinsics must be 4 numbers, not [458.6, 457.3]"),
        ("458.6", "-458.6", "focal lengths must be above 0 px"),
        ("[752, 480]", "[752, wide]", "resolution must be 2 numbers"),
        ("[752, 480]", "[752, true]", "resolution must be 2 numbers, not [752, True]"),
        ("458.6", str(10**400), "intrinsics must be 4 numbers"),
        ("camera_model", "model", "has no camera of Kalibr"),
        ("cam0:", "  cam0:", "line 15: unexpected indentation"),
    ],
)
def test_what_vm_detect_can_not_take_is_one_line(convert, old, new, problem):
    text = CAMCHAIN.replace(old, new) if old else CAMCHAIN
    printed = convert(text, *(("--camera", "cam0") if old else ()), code=1)
    assert problem in printed
    assert printed.count("\n") == 1


def test_an_unknown_camera_and_a_missing_file_are_errors(convert, tmp_path, capsys):
    assert "unknown camera 'cam2'; did you mean 'cam1'? (allowed: cam0, cam1)" in convert(
        CAMCHAIN, "--camera", "cam2", code=1
    )
    missing = run(capsys, "kalibr", tmp_path / "none.yaml", "-o", tmp_path / "lens.yaml", code=1)
    assert "none.yaml: No such file" in missing
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00")
    assert "it is not UTF-8 text" in run(capsys, "kalibr", tmp_path / "bytes.yaml", "-o", tmp_path / "l.yaml", code=1)
