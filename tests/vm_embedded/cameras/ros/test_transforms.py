"""tf: transforms between frames at a time."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vm_embedded.cameras.ros.camera_poses import newest_pose, orientation_of
from vm_embedded.cameras.ros.transforms import Transform, TransformTree, transform_message
from vm_embedded.errors import GeometryError, InputError
from vm_embedded.geometry.orientation import (
    OPTICAL_TO_CAMERA,
    Orientation,
    quaternion_from_rotation,
    rotation_from_quaternion,
)

from .rolling_ball import TYPES, stamp, transform

NUMBERS = st.floats(-3.0, 3.0)
TURNS = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(lambda each: Rotation.from_rotvec(each).as_matrix())
PLACES = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array)
TRANSFORMS = st.tuples(TURNS, PLACES)


def tree_of(*joints):
    """A tree of fixed joints: parent, child, (rotation, translation)."""
    tree = TransformTree()
    for parent, child, (rotation, place) in joints:
        tree.add(transform(parent, child, 0.0, rotation, place), None)
    return tree


@given(TRANSFORMS, TRANSFORMS, TRANSFORMS, PLACES)
def test_transforms_along_both_branches_agree_with_points(one, two, three, point):
    """A point is taken from frame c up to the root a, and down to frame d."""
    tree = tree_of(("a", "b", one), ("b", "c", two), ("a", "d", three))
    in_a = one[0] @ (two[0] @ point + two[1]) + one[1]
    in_d = three[0].T @ (in_a - three[1])
    for target, expected in (("a", in_a), ("d", in_d), ("c", point)):
        found = tree.at(target, "c", 0.0)
        assert np.allclose(found.rotation @ point + found.translation, expected)
    back = tree.at("c", "d", 0.0)
    assert np.allclose(back.rotation @ in_d + back.translation, point)


@given(TURNS)
def test_quaternions_and_rotations_are_inverse(rotation):
    quaternion = quaternion_from_rotation(rotation)
    assert quaternion[0] >= 0.0
    assert math.isclose(math.hypot(*quaternion), 1.0)
    assert np.allclose(rotation_from_quaternion(quaternion), rotation)


@given(st.floats(0.1, 0.9), NUMBERS, NUMBERS)
def test_a_joint_is_interpolated_between_two_times(share, turn, place):
    assume(abs(turn) > 1e-3)
    tree = TransformTree()
    for time, part in ((1.0, 0.0), (2.0, 1.0)):
        rotation = Rotation.from_rotvec([0.0, 0.0, part * turn]).as_matrix()
        tree.add(transform("a", "b", time, rotation, [part * place, 0.0, 0.0]), time)
    found = tree.at("a", "b", 1.0 + share)
    assert np.allclose(Rotation.from_matrix(found.rotation).as_rotvec(), [0.0, 0.0, share * turn])
    assert math.isclose(found.translation[0], share * place, abs_tol=1e-12)
    assert tree.newest("a", "b") == 2.0
    for time, part in ((0.0, 0.0), (3.0, 1.0)):  # it is not extrapolated
        assert math.isclose(tree.at("a", "b", time).translation[0], part * place)


def test_a_chain_is_known_until_its_oldest_joint():
    tree = TransformTree()
    eye, place = np.eye(3), np.zeros(3)
    tree.add(transform("a", "b", 0.0, eye, place), 5.0)
    tree.add(transform("b", "c", 0.0, eye, place), 4.0)
    tree.add(transform("c", "d", 0.0, eye, place), None)
    assert tree.newest("a", "d") == 4.0
    assert math.isinf(tree.newest("c", "d"))
    tree.add(transform("a", "b", 0.0, eye, place), 4.5)  # older than the last one: ignored
    assert tree.newest("a", "b") == 5.0
    tree.add(transform("a", "b", 0.0, eye, place), -20.0)  # the clock was set back
    assert tree.newest("a", "b") == -20.0


def test_names_with_the_slash_of_ros_1_are_the_same():
    tree = tree_of(("/a", "/b", (np.eye(3), np.array([1.0, 0.0, 0.0]))))
    assert tree.at("a", "/b", 0.0).translation[0] == 1.0


@pytest.mark.parametrize(
    ("target", "reason"),
    [
        ("base_footprnt", "unknown tf frame 'base_footprnt'; did you mean 'base_footprint'?"),
        ("map", "tf does not connect map and camera"),
    ],
)
def test_frames_that_are_not_connected_are_an_error(target, reason):
    still = (np.eye(3), np.zeros(3))
    tree = tree_of(("base_footprint", "camera", still), ("map", "door", still))
    with pytest.raises(InputError) as error:
        tree.newest(target, "camera")
    assert reason in str(error.value)


def test_a_loop_is_an_error():
    still = (np.eye(3), np.zeros(3))
    with pytest.raises(InputError, match="tf has a loop through"):
        tree_of(("a", "b", still), ("b", "a", still)).at("a", "b", 0.0)


@pytest.mark.parametrize("change", [{"w": 2.0}, {"x": math.nan}])
def test_a_rotation_of_wrong_numbers_is_an_error(change):
    message = transform("a", "b", 0.0, np.eye(3), np.zeros(3))
    for name, value in change.items():
        setattr(message.transform.rotation, name, value)
    with pytest.raises(GeometryError, match="quaternion must be"):
        TransformTree().add(message, 0.0)


@given(st.floats(0.2, 2.0), st.floats(-0.5, 0.5), st.floats(-0.5, 1.0), NUMBERS)
def test_an_orientation_survives_its_transform(height, roll, pitch, yaw):
    orientation = Orientation.from_roll_pitch(height, roll, pitch, yaw)
    header = TYPES.Header(stamp=stamp(0.0), frame_id="base_footprint")
    message = transform_message(TYPES, header, "camera_optical", orientation)
    found = orientation_of(Transform.from_message(message.transform))
    assert math.isclose(found.height, height)
    assert np.allclose(found.rotation, orientation.rotation)


def test_a_fixed_camera_has_a_pose_at_the_time_of_each_frame():
    tree = tree_of(("base_footprint", "camera", (OPTICAL_TO_CAMERA, np.array([0.0, 0.0, 0.7]))))
    time, orientation = newest_pose(tree, "base_footprint", "camera", -math.inf, 12.0)
    assert (time, orientation.height) == (12.0, 0.7)
    assert np.allclose(orientation.rotation, np.eye(3))
    assert newest_pose(tree, "base_footprint", "camera", 12.0, 12.0) is None


def test_a_camera_below_the_plane_is_an_error():
    tree = tree_of(("base_footprint", "camera", (OPTICAL_TO_CAMERA, np.array([0.0, 0.0, -0.7]))))
    with pytest.raises(GeometryError, match="camera height must be a number above 0 m"):
        newest_pose(tree, "base_footprint", "camera", -math.inf, 12.0)


def test_names_without_end_do_not_fill_the_memory():
    tree = tree_of(*[("map", f"leaf{number}", (np.eye(3), np.zeros(3))) for number in range(1000)])
    with pytest.raises(InputError, match=r"^tf has more than 1000 frames: leaf1000 is ignored$"):
        tree.add(transform("map", "leaf1000", 0.0, np.eye(3), np.zeros(3)), None)
    tree.add(transform("map", "leaf7", 0.0, np.eye(3), np.ones(3)), None)
    assert tree.at("map", "leaf7", 0.0).translation.tolist() == [1.0, 1.0, 1.0]
