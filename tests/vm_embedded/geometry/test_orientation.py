import math

import numpy as np
import pytest
from hypothesis import given

from vm_embedded.errors import GeometryError
from vm_embedded.geometry.orientation import OPTICAL_TO_CAMERA, Orientation, rotation_z

from ..strategies import orientations, reals, rotation, seeds

heights = reals(0.01, 100.0)
turns = reals(-math.pi, math.pi)
tilts = reals(-1.5, 1.5)
"""Pitches short of straight up and down, where roll and yaw are the same turn."""


def hoc(height, matrix):
    """The 4 x 4 transform, its translation along the ground being of no matter."""
    transform = np.eye(4)
    transform[:3, :3] = matrix
    transform[:3, 3] = 3.0, -7.0, height
    return transform


def quaternion_of(axis_angle):
    """(w, x, y, z) of a rotation vector."""
    angle = np.linalg.norm(axis_angle)
    return np.append(math.cos(angle / 2.0), np.asarray(axis_angle) * np.sinc(angle / (2.0 * np.pi)) / 2.0)


@given(heights, turns, tilts, turns)
def test_roll_pitch_and_yaw_round_trip(height, roll, pitch, yaw):
    orientation = Orientation.from_roll_pitch(height, roll, pitch, yaw)
    assert orientation.height == height
    assert orientation.pitch == pytest.approx(pitch, abs=1e-9)
    for found, given_one in ((orientation.roll, roll), (orientation.yaw, yaw)):
        assert math.remainder(found - given_one, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@given(turns, reals(-math.pi / 2, math.pi / 2), turns)
def test_yaw_changes_nothing_about_the_level_rotation(roll, pitch, yaw):
    plain = Orientation.from_roll_pitch(1.0, roll, pitch)
    turned = Orientation(1.0, rotation_z(yaw) @ plain.rotation)
    np.testing.assert_allclose(turned.level, plain.level, atol=1e-6)


@given(turns, tilts)
def test_without_yaw_the_level_rotation_is_the_rotation(roll, pitch):
    orientation = Orientation.from_roll_pitch(1.0, roll, pitch)
    np.testing.assert_allclose(orientation.level, orientation.rotation, atol=1e-9)


@given(orientations())
def test_rotation_is_the_level_one_turned_by_the_yaw(orientation):
    np.testing.assert_allclose(rotation_z(orientation.yaw) @ orientation.level, orientation.rotation, atol=1e-12)


@given(orientations())
def test_the_level_rotation_is_that_of_its_own_roll_and_pitch(orientation):
    rebuilt = Orientation.from_roll_pitch(orientation.height, orientation.roll, orientation.pitch)
    np.testing.assert_allclose(rebuilt.rotation, orientation.level, atol=1e-6)


@given(orientations())
def test_the_level_rotation_keeps_heights_over_the_plane(orientation):
    """Yaw turns around the vertical, so what a camera ray does up and down is the same."""
    np.testing.assert_allclose(orientation.level[2], orientation.rotation[2], atol=1e-12)


@pytest.mark.parametrize("pitch", [math.pi / 2, math.pi / 2 - 1e-10, math.pi / 2 - 1e-7, -math.pi / 2])
@given(turns, turns)
def test_straight_down_or_up_is_an_orientation_like_any_other(pitch, roll, yaw):
    orientation = Orientation.from_roll_pitch(0.8, roll, pitch, yaw)
    assert orientation.pitch == pytest.approx(pitch, abs=1e-6)
    np.testing.assert_allclose(orientation.level @ orientation.level.T, np.eye(3), atol=1e-12)
    axis = orientation.level[:, 0]
    np.testing.assert_allclose(axis, [0.0, 0.0, -math.copysign(1.0, pitch)], atol=1e-6)
    rebuilt = Orientation.from_roll_pitch(0.8, orientation.roll, orientation.pitch, orientation.yaw)
    np.testing.assert_allclose(rebuilt.rotation, orientation.rotation, atol=1e-6)


def test_pitch_looks_down_and_roll_leans_to_the_right():
    ahead, left, up = np.eye(3)
    pitched = Orientation.from_roll_pitch(1.0, pitch=0.3).rotation
    assert (pitched @ ahead)[2] == pytest.approx(-math.sin(0.3))
    assert (pitched @ left)[2] == 0.0
    rolled = Orientation.from_roll_pitch(1.0, roll=0.3).rotation
    assert (rolled @ left)[2] == pytest.approx(math.sin(0.3))  # the left side rises
    assert (rolled @ up)[1] == pytest.approx(-math.sin(0.3))  # the top goes right
    np.testing.assert_array_equal(rolled @ ahead, ahead)
    turned = Orientation.from_roll_pitch(1.0, yaw=0.3).rotation
    assert (turned @ ahead)[1] == pytest.approx(math.sin(0.3))


@given(orientations())
def test_from_hoc_takes_the_rotation_and_the_height(orientation):
    found = Orientation.from_hoc(hoc(orientation.height, orientation.rotation).tolist())
    assert found.height == orientation.height
    np.testing.assert_array_equal(found.rotation, orientation.rotation)


@given(seeds)
def test_from_quaternion_and_from_hoc_agree(seed):
    vector = np.random.default_rng(seed).uniform(-3.0, 3.0, 3)
    quaternion, matrix = quaternion_of(vector), rotation(vector)
    for sign in (1.0, -1.0):
        np.testing.assert_allclose(Orientation.from_quaternion(0.7, sign * quaternion).rotation, matrix, atol=1e-12)
    assert Orientation.from_quaternion(0.7, list(quaternion)).height == Orientation.from_hoc(hoc(0.7, matrix)).height


@given(turns, turns, turns)
def test_from_quaternion_and_from_roll_pitch_agree(roll, pitch, yaw):
    def product(p, q):
        (a, *u), (b, *v) = p, q
        return np.append(a * b - np.dot(u, v), a * np.array(v) + b * np.array(u) + np.cross(u, v))

    around_z, around_y, around_x = (quaternion_of(v) for v in ([0, 0, yaw], [0, pitch, 0], [roll, 0, 0]))
    found = Orientation.from_quaternion(1.0, product(product(around_z, around_y), around_x))
    np.testing.assert_allclose(found.rotation, Orientation.from_roll_pitch(1.0, roll, pitch, yaw).rotation, atol=1e-12)


@given(seeds)
def test_an_optical_quaternion_turns_the_optical_frame(seed):
    vector = np.random.default_rng(seed).uniform(-3.0, 3.0, 3)
    right, down, forward = rotation(vector).T  # where the optical frame's axes point in the plane's frame
    found = Orientation.from_quaternion(1.0, quaternion_of(vector), optical=True)
    np.testing.assert_allclose(found.rotation, np.stack([forward, -right, -down], axis=1), atol=1e-12)


def test_the_optical_frame_looks_along_z_with_x_to_the_right_and_y_down():
    np.testing.assert_array_equal(OPTICAL_TO_CAMERA @ [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(OPTICAL_TO_CAMERA @ [1.0, 0.0, 0.0], [0.0, -1.0, 0.0])
    np.testing.assert_array_equal(OPTICAL_TO_CAMERA @ [0.0, 1.0, 0.0], [0.0, 0.0, -1.0])


def test_a_level_ros_camera_has_the_quaternion_that_ros_gives_it():
    """(0.5, -0.5, 0.5, -0.5): the optical frame of a camera that looks along the plane's x."""
    found = Orientation.from_quaternion(1.0, (0.5, -0.5, 0.5, -0.5), optical=True)
    np.testing.assert_allclose(found.rotation, np.eye(3), atol=1e-15)


@pytest.mark.parametrize(
    "quaternion", [(1.0, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0), (10**400, 0, 0, 0), (math.nan, 0.0, 0.0, 0.0), None, "wxyz"]
)
def test_what_is_not_a_quaternion_is_refused(quaternion):
    with pytest.raises(GeometryError, match=r"quaternion must be \(w, x, y, z\) of length 1, not "):
        Orientation.from_quaternion(1.0, quaternion)


@pytest.mark.parametrize("rotation", [None, "level", np.eye(2), [[1.0, 0.0], [0.0]], np.full((3, 3), math.nan)])
def test_what_is_not_3_x_3_numbers_is_not_a_rotation(rotation):
    with pytest.raises(GeometryError, match="camera rotation must be 3 x 3 finite numbers"):
        Orientation(1.0, rotation)


@given(orientations(), seeds)
def test_rotations_of_few_digits_are_accepted(orientation, seed):
    """Files of the reference hold six digits; half of what is allowed passes in any case."""
    noise = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, 3)) * 1e-4
    found = Orientation(orientation.height, orientation.rotation + noise)
    np.testing.assert_array_equal(found.rotation, orientation.rotation + noise)


@given(orientations())
def test_an_orientation_can_not_be_changed_from_outside(orientation):
    source = np.array(orientation.rotation)
    mine = Orientation(orientation.height, source)
    source[:] = 0.0
    np.testing.assert_array_equal(mine.rotation, orientation.rotation)
    for array in (mine.rotation, mine.level):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 2.0


@pytest.mark.parametrize("height", [0.0, -0.5, math.nan, math.inf, -math.inf])
def test_a_camera_that_is_not_above_the_plane_is_refused(height):
    makers = (
        lambda: Orientation(height, np.eye(3)),
        lambda: Orientation.from_roll_pitch(height),
        lambda: Orientation.from_quaternion(height, (1.0, 0.0, 0.0, 0.0)),
        lambda: Orientation.from_hoc(hoc(height, np.eye(3))),
    )
    for make in makers:
        with pytest.raises(GeometryError, match="height"):
            make()


WRONG_ROTATIONS = {
    "NaN": np.full((3, 3), math.nan),
    "one infinity": np.eye(3) + np.diag([math.inf, 0.0, 0.0]),
    "stretched": 1.01 * np.eye(3),
    "sheared": np.eye(3) + np.diag([0.02, 0.0], 1),
    "mirrored": np.diag([1.0, -1.0, 1.0]),
    "inverted": -np.eye(3),
    "zero": np.zeros((3, 3)),
    "2 x 2": np.eye(2),
}


@pytest.mark.parametrize("matrix", WRONG_ROTATIONS.values(), ids=WRONG_ROTATIONS)
def test_what_is_not_a_rotation_is_refused(matrix):
    with pytest.raises(GeometryError, match="rotation"):
        Orientation(1.0, matrix)


WRONG_TRANSFORMS = {
    "3 x 3": np.eye(3).tolist(),
    "text": "identity",
    "words": [["a"] * 4] * 4,
    "ragged": [[1.0, 0.0], [0.0]],
    "nothing": None,
    "table": {"data": [1.0] * 16},
}


@pytest.mark.parametrize("transform", WRONG_TRANSFORMS.values(), ids=WRONG_TRANSFORMS)
def test_what_is_not_a_transform_is_refused(transform):
    with pytest.raises(GeometryError, match="Hoc"):
        Orientation.from_hoc(transform)


@pytest.mark.parametrize(
    "quaternion",
    [
        (2.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0),
        (0.99, 0.0, 0.0, 0.0),
        (1.002, 0.0, 0.0, 0.0),
        (math.nan, 0.0, 0.0, 1.0),
        (1.0, 0.0, 0.0),
    ],
)
def test_a_quaternion_that_is_not_of_length_1_is_refused(quaternion):
    with pytest.raises(GeometryError, match="quaternion"):
        Orientation.from_quaternion(1.0, quaternion)


def test_a_quaternion_of_few_digits_is_made_one_of_length_1():
    matrix = Orientation.from_quaternion(1.0, (1.0004, 0.0, 0.0, 0.0)).rotation
    np.testing.assert_allclose(matrix, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("name", ["roll", "pitch"])
def test_degrees_are_refused_with_a_hint(name):
    with pytest.raises(GeometryError, match=rf"{name} of 20 rad is more than a full turn.*math.radians\(20\)"):
        Orientation.from_roll_pitch(0.8, **{name: 20})
    with pytest.raises(GeometryError, match="finite"):
        Orientation.from_roll_pitch(0.8, **{name: math.inf})
