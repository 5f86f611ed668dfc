"""Numbers in the calls of the package: those of numpy and OpenCV count, anything else is an error with its name."""

import json
import math
import pickle
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest

from vm_embedded import (
    BrownLens,
    Circle,
    Cylinder,
    Equidistant,
    Equisolid,
    FisheyeLens,
    GeometryError,
    InputError,
    Orientation,
    Plane,
    Rectilinear,
    Settings,
    Sphere,
    Tracker,
    TrackSettings,
    build_mesh,
    read_lens_file,
)
from vm_embedded.arrays import one_number
from vm_embedded.detection.detector import Detector
from vm_embedded.network.bundled import model_path

CALIBRATED = {"focal_lengths": (300.0, 300.0), "optical_center": (160.0, 120.0)}
CALLS = {
    "height": (0.8, lambda value: Orientation(value, np.eye(3)).height),
    "height of angles": (0.8, lambda value: Orientation.from_roll_pitch(value, 0.1, 0.2).height),
    "roll": (0.1, lambda value: Orientation.from_roll_pitch(0.8, roll=value).roll),
    "pitch": (0.2, lambda value: Orientation.from_roll_pitch(0.8, pitch=value).pitch),
    "yaw": (0.3, lambda value: Orientation.from_roll_pitch(0.8, yaw=value).yaw),
    "height of a quaternion": (0.8, lambda value: Orientation.from_quaternion(value, (1.0, 0.0, 0.0, 0.0)).height),
    "radius": (0.1, lambda value: Sphere(value).radius),
    "radius of a disk": (0.1, lambda value: Circle(value).radius),
    "radius of a post": (0.1, lambda value: Cylinder(value, 1.0).radius),
    "object_height": (0.5, lambda value: Cylinder(0.1, value).object_height),
    "fov": (1.5, lambda value: Equisolid(focal_length=300.0, fov=value).fov),
    "fov of a fisheye": (1.5, lambda value: FisheyeLens(fov=value, **CALIBRATED).fov),
    "fov of a plumb bob": (1.5, lambda value: BrownLens(fov=value, **CALIBRATED).fov),
    "focal_length": (300.0, lambda value: Equidistant(focal_length=value, fov=1.5).focal_length),
    "horizontal fov": (1.2, lambda value: Rectilinear.from_horizontal_fov(value, (320, 240)).focal_length),
    "intersections": (6.0, lambda value: len(build_mesh(Sphere(0.1), 0.8, value, 5.0).rays)),
    "max_distance": (5.0, lambda value: len(build_mesh(Sphere(0.1), 0.8, 6.0, value).rays)),
    "height of a mesh": (0.8, lambda value: len(build_mesh(Sphere(0.1), value, 6.0, 5.0).rays)),
    "threshold": (0.5, lambda value: Settings(threshold=value).threshold),
    "object_radius": (0.11, lambda value: Settings(object_radius=value).object_radius),
    "gate": (3.0, lambda value: TrackSettings(gate=value).gate),
}
"""For each argument: a good value, and a call whose result depends on it."""

KINDS = [
    np.float64, np.float32, lambda value: np.array(value), lambda value: np.array([value]),
    lambda value: np.array([[value]], dtype=np.float32),
]  # fmt: skip
OTHERS = [
    "0.8",
    "much",
    b"0.8",
    [0.8],
    (0.8, 0.9),
    [],
    [[1], [2, 3]],
    {},
    True,
    np.array([0.8, 0.9]),
    np.array([]),
    1j,
    object,
]


@pytest.mark.parametrize("name", CALLS)
def test_a_number_of_numpy_and_an_array_of_one_are_numbers(name):
    value, call = CALLS[name]
    wanted = call(value)
    for kind in KINDS:
        found = call(kind(value))
        assert isinstance(found, int if isinstance(wanted, int) else float)
        assert found == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("name", CALLS)
def test_anything_else_is_an_error_that_names_the_argument(name):
    argument = name.partition(" of ")[0].removeprefix("horizontal ")
    for other in (*OTHERS, None):
        if other is None and name == "object_radius":
            continue  # None chooses the model's own radius
        with pytest.raises(InputError, match=argument) as caught:
            CALLS[name][1](other)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", CALLS)
def test_numbers_that_make_no_sense_are_errors_as_floats_and_as_arrays(name):
    for value in (math.nan, math.inf, -1.0):
        if value == -1.0 and name in ("roll", "pitch", "yaw"):
            continue
        for each in (value, np.array([value])):
            with pytest.raises((InputError, GeometryError)):
                CALLS[name][1](each)


def test_decimals_and_fractions_are_numbers():
    assert one_number(Decimal("0.5"), "x") == one_number(Fraction(1, 2), "x") == 0.5
    assert one_number(10**30, "x") == 1e30
    with pytest.raises(InputError, match="x must be a number"):
        one_number(10**400, "x")


def test_texts_that_look_like_numbers_are_no_arrays_of_numbers():
    with pytest.raises(GeometryError, match="Hoc"):
        Orientation.from_hoc(np.eye(4).astype(str))
    with pytest.raises(GeometryError, match="rotation"):
        Orientation(0.8, [["1", "0", "0"], ["0", "1", "0"], ["0", "0", "1"]])
    with pytest.raises(GeometryError, match="quaternion"):
        Orientation.from_quaternion(0.8, ("1", "0", "0", "0"))
    with pytest.raises(InputError, match="center"):
        Equisolid(focal_length=300.0, fov=1.5, center=("1", "2"))
    with pytest.raises(InputError, match="size"):
        Rectilinear.from_horizontal_fov(1.2, ("320", "240"))


def test_what_opencv_returns_goes_in_as_it_is():
    """solvePnP gives rotation and position as columns (3, 1), calibrateCamera the coefficients as a row (1, 5)."""
    board = np.array([[x, y, 0.0] for x in range(4) for y in range(3)], dtype=np.float32)
    matrix = np.array([[300.0, 0.0, 160.0], [0.0, 300.0, 120.0], [0.0, 0.0, 1.0]])
    pixels, _ = cv2.projectPoints(board, np.array([2.0, 0.1, 0.0]), np.array([-1.0, 0.5, 6.0]), matrix, None)
    _, turn, shift = cv2.solvePnP(board, pixels, matrix, None)
    world_to_camera = cv2.Rodrigues(turn)[0]
    height = (-world_to_camera.T @ shift)[2]
    assert height.shape == (1,)
    orientation = Orientation(abs(height), world_to_camera.T @ np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]))
    assert isinstance(orientation.height, float)
    lens = BrownLens(
        fov=np.array([1.5]),
        focal_lengths=matrix[[0, 1], [0, 1]],
        optical_center=matrix[:2, 2:],
        coefficients=np.zeros((1, 5)),
        size=np.array([320, 240]),
    )
    assert hash(lens) == hash(pickle.loads(pickle.dumps(lens)))
    assert Plane("table", offset=np.array([0.5])).offset == 0.5
    assert json.dumps([orientation.height, lens.fov, Sphere(np.float32(0.5)).radius])


def test_the_time_of_a_frame_may_be_a_number_of_numpy():
    demo = Path(__file__).parents[1] / "fixtures/demo"
    file = read_lens_file(demo / "lens0000002.yaml")
    detections = Detector.from_file(model_path("ball")).detect(
        cv2.imread(str(demo / "image0000002.jpg")), file.orientation, file.lens
    )
    tracker = Tracker()
    assert len(tracker.update(detections, np.array([0.5])).objects) == len(detections.objects)
    for wrong in (None, "0.5", np.array([0.5, 0.6])):
        with pytest.raises(InputError, match="time"):
            tracker.update(detections, wrong)
