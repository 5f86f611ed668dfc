import math
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_embedded.geometry.calibrated_lenses import BrownLens, FisheyeLens
from vm_embedded.geometry.lens_files import format_lens_file, lens_from_calibration, lens_from_table, read_lens_file
from vm_embedded.geometry.radial_lenses import PROJECTIONS, Equidistant, Equisolid, Rectilinear

from ..strategies import attempt

FIXTURES = Path(__file__).parents[2] / "fixtures"

REFERENCE = """\
projection: EQUISOLID
focal_length: 420
centre: [1.5, -2]
k: [1.0e-7, 0]
fov: 1.8
Hoc:
  - [0, -1, 0, 4]
  - [1, 0, 0, 5]
  - [0, 0, 1, 0.8]
  - [0, 0, 0, 1]
"""

TOML = """\
projection = "rectilinear"
focal_length = 500
fov = 1.5
center = [3.0, 4]
distortion = [1e-7, 0.0]
size = [640, 480]
"""

MATRIX = {"focal_lengths": (612.25, 611.75), "optical_center": (318.5, 241.25), "size": (640, 480)}


def camera_info(model, coefficients):
    return f"""\
image_width: 640
image_height: 480
camera_name: head
camera_matrix:
  rows: 3
  cols: 3
  data: [612.25, 0, 318.5, 0, 611.75, 241.25, 0, 0, 1]
distortion_model: {model}
distortion_coefficients:
  rows: 1
  cols: {len(coefficients)}
  data: {list(coefficients)}
"""


@pytest.fixture
def write(tmp_path):
    def written(text, name="lens.yaml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return written


def test_a_reference_lens_file_gives_lens_and_orientation(write):
    file = read_lens_file(write(REFERENCE))
    assert file.lens == Equisolid(focal_length=420.0, fov=1.8, center=(1.5, -2.0), distortion=(1e-7, 0.0))
    assert file.orientation.height == 0.8
    np.testing.assert_array_equal(file.orientation.rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])


def test_a_reference_lens_file_may_lack_the_orientation(write):
    assert read_lens_file(write(REFERENCE.split("Hoc")[0])).orientation is None


@pytest.mark.parametrize("folder", ["reference", "real"])
def test_real_lens_files_are_read(shared, folder):
    paths = sorted((shared / folder / "images").glob("lens*.yaml"))
    assert paths
    for path in paths:
        assert_read_as_written(path)


def test_the_lens_files_of_the_drawn_frames_are_read():
    paths = sorted((FIXTURES / "drawn").glob("lens*.yaml"))
    assert paths
    for path in paths:
        assert_read_as_written(path)


def assert_read_as_written(path):
    data = yaml.safe_load(path.read_text())
    file = read_lens_file(path)
    assert type(file.lens) is PROJECTIONS[data["projection"].lower()]
    assert file.lens.focal_length == data["focal_length"]
    assert file.lens.center == tuple(data.get("centre", data.get("center", (0, 0))))
    assert file.lens.distortion == tuple(data.get("k", data.get("distortion", (0, 0))))
    assert file.lens.fov == data["fov"]
    hoc = np.array(data["Hoc"])
    assert file.orientation.height == hoc[2, 3]
    np.testing.assert_array_equal(file.orientation.rotation, hoc[:3, :3])


@pytest.mark.parametrize("text", [TOML, "[lens]\n" + TOML], ids=["bare", "table"])
def test_a_toml_lens_is_read(write, text):
    file = read_lens_file(write(text, "lens.toml"))
    expected = Rectilinear(focal_length=500.0, fov=1.5, center=(3.0, 4.0), distortion=(1e-7, 0.0), size=(640, 480))
    assert file.lens == expected
    assert file.orientation is None


def test_what_does_not_matter_may_be_left_out():
    lens = lens_from_table({"projection": "Equidistant", "focal_length": 300, "fov": 2})
    assert lens == Equidistant(focal_length=300.0, fov=2.0)
    lens = lens_from_table({"projection": "Equidistant", "focal_length": 300, "fov": "180deg"})
    assert lens.fov == math.pi


PLUMB_BOB = (-0.35, 0.125, 0.0005, -0.00025, 0.01)
RATIONAL = (*PLUMB_BOB, 0.2, 0.05, 0.001)
FISHEYE = (0.01, -0.002, 0.0005, -0.0001)


@pytest.mark.parametrize(
    ("model", "coefficients", "kind"),
    [
        ("plumb_bob", (), BrownLens),
        ("plumb_bob", PLUMB_BOB[:4], BrownLens),
        ("plumb_bob", PLUMB_BOB, BrownLens),
        ("rational_polynomial", RATIONAL, BrownLens),
        ("equidistant", FISHEYE, FisheyeLens),
        ("fisheye", FISHEYE, FisheyeLens),
    ],
)
def test_a_camera_info_is_read(write, model, coefficients, kind):
    file = read_lens_file(write(camera_info(model, coefficients)))
    fov = math.radians(160.0) if kind is BrownLens else 2.0 * math.pi
    assert file.lens == kind(**MATRIX, coefficients=coefficients, fov=fov)
    assert file.orientation is None


@pytest.mark.parametrize(
    ("model", "lens"),
    [
        ("plumb_bob", BrownLens(**MATRIX, coefficients=PLUMB_BOB, fov=2.0)),
        ("rational_polynomial", BrownLens(**MATRIX, coefficients=RATIONAL, fov=2.0)),
        ("equidistant", FisheyeLens(**MATRIX, coefficients=FISHEYE, fov=2.0)),
    ],
)
def test_a_written_lens_has_the_name_of_ros_for_its_model(write, model, lens):
    text = format_lens_file(lens, None)
    assert f"distortion_model: {model}\n" in text
    assert read_lens_file(write(text)).lens.coefficients == lens.coefficients


def test_a_camera_info_message_is_read(write):
    """As ROS prints it: K and D (ROS 1) or k and d (ROS 2), flat."""
    text = """\
height: 480
width: 640
distortion_model: plumb_bob
D: [-0.35, 0.125, 0.0005, -0.00025, 0.01]
K: [612.25, 0.0, 318.5, 0.0, 611.75, 241.25, 0.0, 0.0, 1.0]
"""
    expected = BrownLens(**MATRIX, coefficients=PLUMB_BOB, fov=math.radians(160.0))
    assert read_lens_file(write(text)).lens == expected
    assert read_lens_file(write(text.replace("D:", "d:").replace("K:", "k:"))).lens == expected


@pytest.mark.parametrize("rows", [True, False])
def test_a_matrix_may_be_a_list_of_rows(rows):
    matrix = [[612.25, 0, 318.5], [0, 611.75, 241.25], [0, 0, 1]]
    lens = lens_from_calibration({"camera_matrix": matrix if rows else [number for row in matrix for number in row]})
    assert lens == BrownLens(**(MATRIX | {"size": None}), fov=math.radians(160.0))


@pytest.mark.parametrize("names", [("camera_matrix", "distortion_coefficients"), ("cameraMatrix", "distCoeffs")])
@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_what_opencv_writes_is_read(tmp_path, names, count):
    """The longer models too, where the coefficients beyond the eighth are zero."""
    path = tmp_path / "calibration.yml"
    coefficients = (*RATIONAL, *(0.0,) * 6)[:count]
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write(names[0], np.array([[612.25, 0.0, 318.5], [0.0, 611.75, 241.25], [0.0, 0.0, 1.0]]))
    storage.write(names[1], np.array([coefficients]))
    storage.release()
    expected = BrownLens(**MATRIX, coefficients=coefficients[:8], fov=math.radians(160.0))
    assert read_lens_file(path).lens == expected


def opencv_sample(path, fisheye, coefficients):
    """A file as OpenCV's calibration sample writes it."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Mon 04 May 2026 10:11:12")
    storage.write("nr_of_frames", 25)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("flags", 0)
    storage.write("fisheye_model", fisheye)
    storage.write("camera_matrix", np.array([[612.25, 0.0, 318.5], [0.0, 611.75, 241.25], [0.0, 0.0, 1.0]]))
    storage.write("distortion_coefficients", np.array([coefficients]).T)
    storage.write("avg_reprojection_error", 0.25)
    storage.release()
    return path


def test_a_fisheye_of_opencvs_calibration_sample_projects_as_in_opencv(tmp_path):
    lens = read_lens_file(opencv_sample(tmp_path / "out_camera_data.yml", 1, FISHEYE)).lens
    assert lens == FisheyeLens(**MATRIX, coefficients=FISHEYE, fov=2.0 * math.pi)
    rays = np.array([[1.0, 0.0, 0.0], [0.8, 0.5, -0.3], [0.5, -0.7, 0.2]])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    points = np.stack([-rays[:, 1], -rays[:, 2], rays[:, 0]], axis=1)[:, None]
    matrix = np.array([[612.25, 0.0, 318.5], [0.0, 611.75, 241.25], [0.0, 0.0, 1.0]])
    pixels, _ = cv2.fisheye.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array(FISHEYE))
    np.testing.assert_allclose(lens.project(rays, (640, 480)), pixels[:, 0], atol=1e-6)


def test_a_pinhole_of_opencvs_calibration_sample_is_a_brown_lens(tmp_path):
    lens = read_lens_file(opencv_sample(tmp_path / "out_camera_data.yml", 0, PLUMB_BOB)).lens
    assert lens == BrownLens(**MATRIX, coefficients=PLUMB_BOB, fov=math.radians(160.0))


@pytest.mark.parametrize("key", ["dist_coeff", "dist_coeffs", "distCoeffs", "distortion_coeffs"])
def test_no_name_of_the_coefficients_is_ignored(write, key):
    text = f"camera_matrix: [500, 0, 320, 0, 500, 240, 0, 0, 1]\n{key}: {list(PLUMB_BOB)}\n"
    assert read_lens_file(write(text)).lens.coefficients == PLUMB_BOB


ECHO = """\
header:
  stamp:
    sec: 1767225600
    nanosec: 250000000
  frame_id: camera_optical
height: 480
width: 640
distortion_model: plumb_bob
d:
- -0.35
- 0.125
- 0.0005
- -0.00025
- 0.01
k:
- 612.25
- 0.0
- 318.5
- 0.0
- 611.75
- 241.25
- 0.0
- 0.0
- 1.0
binning_x: 0
binning_y: 0
roi:
  x_offset: 0
  y_offset: 0
  height: 0
  width: 0
  do_rectify: false
---
"""


def test_what_ros2_topic_echo_prints_is_read(write):
    expected = BrownLens(**MATRIX, coefficients=PLUMB_BOB, fov=math.radians(160.0))
    assert read_lens_file(write(ECHO)).lens == expected


def test_without_a_model_eight_coefficients_are_rational():
    table = {"K": [500, 0, 320, 0, 500, 240, 0, 0, 1], "D": list(RATIONAL)}
    assert lens_from_calibration(table).coefficients == RATIONAL


@pytest.mark.parametrize("name", ["lens.yaml", "lens.toml", "lens"])
def test_a_missing_file_is_named(tmp_path, name):
    with pytest.raises(InputError, match=rf"{name}.*No such file"):
        read_lens_file(tmp_path / name)


def test_a_folder_is_no_lens_file(tmp_path):
    with pytest.raises(InputError, match=tmp_path.name):
        read_lens_file(tmp_path)


@pytest.mark.parametrize("name", ["lens.yaml", "lens.toml"])
def test_a_binary_file_is_refused(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(bytes(range(256)) * 4)
    with pytest.raises(InputError, match=f"{name}: it is not UTF-8 text"):
        read_lens_file(path)


def test_a_picture_is_no_lens_file(tmp_path):
    path = tmp_path / "picture.yaml"
    path.write_bytes(cv2.imencode(".png", np.zeros((8, 8, 3), dtype=np.uint8))[1].tobytes())
    with pytest.raises(InputError, match=r"picture\.yaml: it is not UTF-8 text"):
        read_lens_file(path)


def test_a_huge_file_is_not_even_read(tmp_path):
    path = tmp_path / "lens.yaml"
    with path.open("wb") as file:
        file.truncate(3 * 2**20)
    with pytest.raises(InputError, match=r"lens\.yaml: it is too large: 3145728 bytes; at most 1048576"):
        read_lens_file(path)


WRONG = {
    "empty": ("", "table"),
    "only a comment": ("# nothing\n", "table"),
    "a list": ("- 1\n- 2\n", "table"),
    "a word": ("lens\n", "table"),
    "not a lens": ("camera: front\nheight: 0.8\n", "neither .*, as in a lens, nor .*, as in a calibration"),
    "not YAML": ("projection: [EQUISOLID\n", "line 1"),
    "unknown key": (REFERENCE.replace("focal_length", "focal_lenght"), "'focal_lenght'.*'focal_length'"),
    "unknown first key": (REFERENCE.replace("projection", "projecton"), "'projecton'.*'projection'"),
    "missing projection": (REFERENCE.replace("projection: EQUISOLID\n", ""), "needs projection"),
    "key in small letters": (REFERENCE.replace("Hoc", "hoc"), r"'hoc'; did you mean 'Hoc'\? .*centre, k, fov"),
    "key without colon": (REFERENCE.replace("Hoc:", "Hoc"), "line 6: expected KEY: VALUE: 'Hoc'"),
    "no space after the colon": (REFERENCE.replace("fov: ", "fov:"), "line 5: expected KEY: VALUE: 'fov:1.8'"),
    "unknown projection": (REFERENCE.replace("EQUISOLID", "EQUISOLD"), "'EQUISOLD'.*'equisolid'"),
    "missing key": (REFERENCE.replace("fov: 1.8\n", ""), "needs fov"),
    "two missing keys": ("projection: EQUISOLID\nk: [0, 0]\n", "needs focal_length, fov"),
    "text for a number": (REFERENCE.replace("420", "long"), "focal_length .*'long'"),
    "true for a number": (REFERENCE.replace("420", "true"), "focal_length .*True"),
    "NaN": (REFERENCE.replace("420", ".nan"), "focal_length"),
    "out of range": (REFERENCE.replace("fov: 1.8", "fov: 180"), "fov .*180"),
    "three for two": (REFERENCE.replace("[1.5, -2]", "[1, 2, 3]"), "center must be 2"),
    "ragged": (REFERENCE.replace("[1.5, -2]", "[[1, 2], [3]]"), "center"),
    "no rotation": (REFERENCE.replace("[0, -1, 0, 4]", "[0, -2, 0, 4]"), "rotation"),
    "ragged Hoc": (REFERENCE.replace("[0, -1, 0, 4]", "[0, -1]"), r"Hoc must be 4 x 4 numbers, not \[\[0, -1\], "),
    "below the plane": (REFERENCE.replace("0.8", "-0.8"), "height"),
    "unknown model": (camera_info("plum_bob", PLUMB_BOB), "'plum_bob'.*'plumb_bob'"),
    "too many coefficients": (camera_info("plumb_bob", (*RATIONAL, 0.1, 0, 0, 0)), "coefficients, not 9"),
    "too few coefficients": (camera_info("equidistant", FISHEYE[:3]), "coefficients, not 3"),
    "two messages of ros2 topic echo": (ECHO + ECHO, "line 34: several documents .*--once"),
    "a key meant for the coefficients": (
        camera_info("plumb_bob", ()) + "dist_coefs: [-0.3, 0.1, 0, 0]\n",
        "'dist_coeffs'",
    ),
    "two models": (
        camera_info("plumb_bob", PLUMB_BOB) + "fisheye_model: 1\n",
        "contradicts distortion_model 'plumb_bob'",
    ),
    "fisheye_model 7": (
        camera_info("fisheye", FISHEYE) + "fisheye_model: 7\n",
        "fisheye_model must be 0 or 1, not '7'",
    ),
    "skew": (camera_info("plumb_bob", PLUMB_BOB).replace("[612.25, 0,", "[612.25, 0.5,"), "skew"),
    "mirrored": (camera_info("plumb_bob", PLUMB_BOB).replace("[612.25, 0,", "[-612.25, 0,"), "focal lengths .*-612"),
    "cut matrix": (camera_info("plumb_bob", PLUMB_BOB).replace(", 0, 0, 1]", "]"), "camera_matrix must be 9"),
    "matrix without data": ("camera_matrix: {rows: 3, cols: 3}\n", "camera_matrix"),
    "words for a matrix": ("camera_matrix: words\n", "camera_matrix"),
    "words for a width": (camera_info("plumb_bob", ()).replace("640", "wide"), "width .*'wide'"),
}


@pytest.mark.parametrize(("text", "says"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_a_yaml_file_is_said(write, text, says):
    with pytest.raises(InputError, match=rf"lens\.yaml.*{says}"):
        read_lens_file(write(text))


WRONG_TOML = {
    "empty": ("", "needs projection, focal_length, fov"),
    "not TOML": ("projection = rectilinear\n", "line 1"),
    "unknown key": (TOML + "focal = 3\n", "'focal'.*'focal_length'"),
    "unknown key in the table": ("[lens]\n" + TOML.replace("center", "centre"), "'centre'.*'center'"),
    "no table": ("lens = 5\n", "lens"),
    "a list of tables": ("[[lens]]\n" + TOML, "lens"),
    "a number for the projection": (TOML.replace('"rectilinear"', "5"), "projection"),
    "infinite": (TOML.replace("500", "inf"), "focal_length"),
    "more digits than a float has": (TOML.replace("500", "5" * 400), "focal_length"),
    "a size of one": (TOML.replace("[640, 480]", "[1, 480]"), "1 x 480"),
    "a size that is not whole": (TOML.replace("[640, 480]", "[640.5, 480]"), "whole numbers"),
    "a size that is none": (TOML.replace("[640, 480]", "640"), "size must be 2"),
}


@pytest.mark.parametrize(("text", "says"), WRONG_TOML.values(), ids=WRONG_TOML)
def test_what_is_wrong_with_a_toml_file_is_said(write, text, says):
    with pytest.raises(InputError, match=rf"lens\.toml.*{says}"):
        read_lens_file(write(text, "lens.toml"))


values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(-1000, 1000), st.floats(), st.text(max_size=5)),
    lambda inner: st.one_of(st.lists(inner, max_size=9), st.dictionaries(st.sampled_from(["data", "a"]), inner)),
    max_leaves=10,
)


@given(
    st.fixed_dictionaries(
        {"projection": st.one_of(st.sampled_from(["rectilinear", "EQUISOLID"]), values), "focal_length": values},
        optional={"fov": values, "center": values, "distortion": values, "size": values},
    )
)
def test_no_table_raises_anything_but_input_error(table):
    lens = attempt(InputError, lens_from_table, table)
    assert isinstance(lens, InputError) or lens.focal_length > 0


@given(
    st.fixed_dictionaries(
        {"camera_matrix": st.one_of(st.just([500, 0, 320, 0, 500, 240, 0, 0, 1]), values)},
        optional={
            "distortion_coefficients": values,
            "image_width": values,
            "image_height": values,
            "distortion_model": st.one_of(st.sampled_from(["plumb_bob", "equidistant"]), values),
        },
    )
)
def test_no_calibration_raises_anything_but_input_error(table):
    lens = attempt(InputError, lens_from_calibration, table)
    assert isinstance(lens, InputError) or min(lens.focal_lengths) > 0


@pytest.mark.parametrize("k", ["[-1e308, 640]", "[640, -1e308]", "[1e308, 1e308]", "[-1e6, 1e-320]", "[1e6, -1e6]"])
@pytest.mark.parametrize("projection", ["RECTILINEAR", "EQUISOLID", "EQUIDISTANT"])
def test_attack_8_a_distortion_of_any_size_is_refused_or_works(k, projection, tmp_path):
    path = tmp_path / "lens.yaml"
    path.write_text(f"projection: {projection}\nfocal_length: 400\ncentre: [0, 0]\nk: {k}\nfov: 1.5\n")
    found = attempt(InputError, read_lens_file, path)
    if isinstance(found, InputError):
        assert "from -1e+06 to 1e+06" in str(found)
        assert "308" in k
    else:
        assert 0.0 < found.lens.limit <= 0.75


CAMERA_MATRIX = "camera_matrix: {rows: 3, cols: 3, data: [420.0, 0, 319.5, 0, 420.0, 255.5, 0, 0, 1]}\n"
FOUR = "distortion_coefficients: [-0.05, 0.02, -0.003, 0.001]\n"


def test_the_model_under_another_key_gives_the_same_places(shared):
    reference, other = (read_lens_file(shared / "cases/lens" / name) for name in ("a_ref.yaml", "b_camera_model.yaml"))
    assert reference.lens == other.lens
    assert isinstance(other.lens, FisheyeLens)


FISHEYES = (
    "distortion_model: equidistant",
    "distortion_model: Kannala-Brandt",
    "distortionModel: fisheye",
    "camera_model: opencv_fisheye",
    "camera_model: pinhole\ndistortion_model: equi",
    "lens_model: KannalaBrandt8",
    "model_type: KANNALA_BRANDT",
    "model: fisheye",
    "type: 'Kb4'",
    "lens: fisheye",
    "distortion: equidistant",
    "projection_model: Equidistant",
    "fisheye: true",
    "fisheye_model: 1",
    "is_fisheye: 1",
)
BROWNS = (
    "",
    "distortion_model: RadTan",
    "camera_model: pinhole",
    "model: brown_conrady",
    "fisheye: 0",
    "distortion_model:",
)


@pytest.mark.parametrize("line", FISHEYES + BROWNS)
def test_no_name_of_a_model_is_ignored(write, line):
    lens = read_lens_file(write(f"{line}\n{CAMERA_MATRIX}{FOUR}")).lens
    assert isinstance(lens, FisheyeLens if line in FISHEYES else BrownLens)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("camera_model: omni\ndistortion_model: radtan", "camera_model 'omni'"),
        ("camera_model: ds", "camera_model 'ds'"),
        ("model: Sony IMX", "model 'Sony IMX'"),
        ("distortion_model: ftheta", "distortion_model 'ftheta'"),
        ("distortion_model: inverse_brown_conrady\ncamera_model: pinhole", "inverse_brown_conrady"),
        ("lens_type: 7", "lens_type 7"),
        ("fisheye: true\ndistortion_model: plumb_bob", "contradicts"),
        ("camera_model: fisheye\ndistortion_model: radtan", "contradicts"),
        ("k1: -0.3", "'k1'"),
        ("xi: 0.9", "'xi'"),
    ],
)
def test_an_unknown_model_is_refused(write, line, says):
    with pytest.raises(InputError, match=says):
        read_lens_file(write(f"{line}\n{CAMERA_MATRIX}{FOUR}"))


def test_the_name_of_a_camera_beside_a_model_does_no_harm(write):
    lens = read_lens_file(write(f"camera_model: Sony IMX\ndistortion_model: fisheye\n{CAMERA_MATRIX}{FOUR}")).lens
    assert isinstance(lens, FisheyeLens)


def test_a_lens_in_a_table_is_read(write):
    nested = "lens:\n" + "".join(f"  {each}\n" for each in REFERENCE.splitlines())
    lens, hoc = nested.split("  Hoc:")
    file = read_lens_file(write(REFERENCE))
    for text in (nested, f"{lens}Hoc:{hoc}"):
        other = read_lens_file(write(text))
        assert other.lens == file.lens
        np.testing.assert_array_equal(other.orientation.rotation, file.orientation.rotation)


NUBOTS = "lens:\n  projection: EQUISOLID\n  focal_length: 0.38\n  centre: [0, 0]\n  k: [0, 0]\n  fov: auto\n"


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("lens.yaml", "# oST version 5.0 parameters\n\n\n[image]\n\nwidth\n640\n\n[narrow_stereo]\n", "INI"),
        ("ost.ini", "; made by hand\n[camera]\nfx = 420\nmodel = fish eye\n", "INI"),
        ("lens.toml", "[image]\n\nwidth\n640\n", "INI"),
        ("calibration.xml", '<?xml version="1.0"?>\n<opencv_storage><a>1</a></opencv_storage>\n', "XML"),
        ("lens.yaml", "<calibration>\n  <f>420</f>\n</calibration>\n", "XML"),
        ("lens.toml", "<opencv_storage>\n", "XML"),
        ("lens.yaml", '[lens]\nprojection = "rectilinear"\n', "TOML"),
        ("lens.yaml", NUBOTS, "NUbots"),
        ("lens.yaml", "name: Left\nserial_number: 3\n" + NUBOTS, "NUbots"),
        ("lens.toml", '[lens]\nprojection = "equisolid"\nfov = "auto"\n', "NUbots"),
        ("lens.yaml", "cam0:\n  camera_model: pinhole\n  intrinsics: [1, 2, 3, 4]\n", "Kalibr"),
        ("lens.yaml", "%YAML:1.0\nCamera.type: PinHole\nCamera.fx: 500\n", "ORB-SLAM"),
        ("lens.yaml", "model_type: MEI\nprojection_parameters:\n  u0: 3\n", "camodocal"),
        ("lens.yaml", "left:\n  " + CAMERA_MATRIX, "table 'left'"),
        ("lens.yaml", "name: front\nlens:\n  projection: EQUISOLID\n", "table 'lens'"),
    ],
)
def test_a_file_of_another_program_is_named(write, name, text, says):
    with pytest.raises(InputError, match=rf"{name}: .*{says}"):
        read_lens_file(write(text, name))
