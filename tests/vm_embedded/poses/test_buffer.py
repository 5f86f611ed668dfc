import json
import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vm_embedded.errors import GeometryError, InputError, VisualMeshError
from vm_embedded.geometry.orientation import OPTICAL_TO_CAMERA, Orientation
from vm_embedded.poses.buffer import PoseBuffer, StalePoseError, interpolate
from vm_embedded.poses.parsing import MAX_LINE_BYTES, parse_pose_line
from vm_embedded.poses.settings import PoseSettings

ANGLES = st.floats(-math.pi, math.pi)
ORIENTATIONS = st.builds(
    Orientation.from_roll_pitch, st.floats(0.3, 2.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.5), ANGLES
)
SHARES = st.floats(0.0, 1.0)


def turn_between(one, other):
    """Angle [rad] between two rotations."""
    cosine = (np.trace(one.rotation.T @ other.rotation) - 1.0) / 2.0
    return math.acos(min(max(cosine, -1.0), 1.0))


def quaternion(orientation):
    """(w, x, y, z), by the largest of the four."""
    r = orientation.rotation
    squares = np.array([1 + np.trace(r), *(1 + 2 * np.diag(r) - np.trace(r))]) / 4.0
    at = int(np.argmax(squares))
    products = np.array(
        [
            [squares[0], (r[2, 1] - r[1, 2]) / 4, (r[0, 2] - r[2, 0]) / 4, (r[1, 0] - r[0, 1]) / 4],
            [(r[2, 1] - r[1, 2]) / 4, squares[1], (r[0, 1] + r[1, 0]) / 4, (r[0, 2] + r[2, 0]) / 4],
            [(r[0, 2] - r[2, 0]) / 4, (r[0, 1] + r[1, 0]) / 4, squares[2], (r[1, 2] + r[2, 1]) / 4],
            [(r[1, 0] - r[0, 1]) / 4, (r[0, 2] + r[2, 0]) / 4, (r[1, 2] + r[2, 1]) / 4, squares[3]],
        ]
    )
    return (products[at] / math.sqrt(squares[at])).tolist()


@given(ORIENTATIONS, ORIENTATIONS, SHARES)
def test_the_way_between_two_orientations_is_straight_and_even(one, other, share):
    whole = turn_between(one, other)
    if whole > 3.0:
        return  # the other way round is as short
    found = interpolate(one, other, share)
    assert turn_between(one, found) == pytest.approx(share * whole, abs=2e-5)
    assert turn_between(found, other) == pytest.approx((1.0 - share) * whole, abs=2e-5)
    assert found.height == pytest.approx(one.height + share * (other.height - one.height))


@given(st.floats(-10.0, 10.0), st.floats(0.05, 0.95))
def test_a_steady_turn_is_met_at_every_moment(rate, moment):
    poses = PoseBuffer(PoseSettings(max_age_ms=200.0, extrapolate_ms=50.0))
    for at in np.linspace(0.0, 0.9, 10).tolist():
        poses.add(at, Orientation.from_roll_pitch(0.6, 0.0, 0.3, rate * at))
    expected = Orientation.from_roll_pitch(0.6, 0.0, 0.3, rate * moment)
    assert turn_between(poses.at(moment), expected) < 2e-5  # OpenCV takes turns below 1e-5 rad for none


def test_motion_goes_on_for_as_long_as_it_may_and_then_stands():
    poses = PoseBuffer(PoseSettings(extrapolate_ms=10.0, max_age_ms=100.0))
    for at in (1.0, 1.02):
        poses.add(at, Orientation.from_roll_pitch(0.6, 0.0, at))
    assert poses.at(1.025).pitch == pytest.approx(1.025)
    assert poses.at(1.03).pitch == pytest.approx(1.03)
    assert poses.at(1.1).pitch == pytest.approx(1.03)
    with pytest.raises(StalePoseError, match="130 ms older"):
        poses.at(1.15)


def test_without_interpolation_the_newest_pose_counts():
    poses = PoseBuffer(PoseSettings(interpolate=False))
    for at in (1.0, 1.02):
        poses.add(at, Orientation.from_roll_pitch(0.6, 0.0, at))
    assert poses.at(1.01).pitch == pytest.approx(1.02)


def test_there_is_no_pose_before_the_first_and_none_long_before_it():
    poses = PoseBuffer(PoseSettings())
    with pytest.raises(StalePoseError, match="no pose"):
        poses.at(1.0)
    for at in (5.0, 5.01):
        poses.add(at, Orientation.from_roll_pitch(0.6))
    with pytest.raises(StalePoseError, match="newer than the frame"):
        poses.at(4.0)


JUMPS = {
    "up": Orientation.from_roll_pitch(0.9),
    "over": Orientation.from_roll_pitch(0.6, 1.0, 0.3),
    "upside down": Orientation.from_roll_pitch(0.6, math.pi),
}


@pytest.mark.parametrize("jump", JUMPS.values(), ids=JUMPS)
def test_a_jump_is_refused_until_the_pose_before_it_is_stale(jump):
    poses = PoseBuffer(PoseSettings(max_age_ms=100.0))
    poses.add(1.0, Orientation.from_roll_pitch(0.6))
    for at in (1.01, 1.02, 1.03):
        with pytest.raises(GeometryError, match=r"in .* ms, faster than"):
            poses.add(at, jump)
    assert poses.at(1.03).height == 0.6
    poses.add(1.11, jump)
    assert poses.at(1.11).height == jump.height


@given(st.floats(-math.pi, math.pi))
def test_a_turn_around_the_vertical_is_no_jump(yaw):
    poses = PoseBuffer(PoseSettings())
    poses.add(1.0, Orientation.from_roll_pitch(0.6, 0.0, 0.3))
    poses.add(1.01, Orientation.from_roll_pitch(0.6, 0.0, 0.3, yaw))
    assert len(poses) == 2


def test_times_only_go_on_unless_a_clock_was_set_back():
    poses = PoseBuffer(PoseSettings())
    poses.add(100.0, Orientation.from_roll_pitch(0.6))
    for at in (100.0, 99.9):
        with pytest.raises(GeometryError, match="not newer"):
            poses.add(at, Orientation.from_roll_pitch(0.6))
    poses.add(10.0, Orientation.from_roll_pitch(0.8))
    assert poses.at(10.0).height == 0.8


def test_only_the_last_seconds_are_kept():
    poses = PoseBuffer(PoseSettings())
    for at in range(2000):
        poses.add(0.01 * at, Orientation.from_roll_pitch(0.6))
    assert len(poses) <= 302


@given(ORIENTATIONS, st.floats(0.0, 1e6), st.booleans())
def test_a_line_says_what_it_was_made_from(orientation, at, optical):
    turned = orientation
    if optical:
        turned = Orientation(orientation.height, orientation.rotation @ OPTICAL_TO_CAMERA)
    hoc = np.eye(4)
    hoc[:3, :3], hoc[2, 3] = turned.rotation, turned.height
    for pose in ({"height": turned.height, "quaternion": quaternion(turned)}, {"Hoc": hoc.tolist()}):
        found = parse_pose_line(json.dumps({"t": at, **pose}).encode(), optical)
        assert found.time == at
        assert found.orientation.height == orientation.height
        assert np.abs(found.orientation.rotation - orientation.rotation).max() < 1e-9


WRONG = {
    "no JSON": (b"{", "not valid JSON"),
    "a list": (b"[1, 2]", "must be like"),
    "another key": (b'{"t": 1, "hight": 1, "quaternion": [1, 0, 0, 0]}', "did you mean 'height'"),
    "no height": (b'{"t": 1, "quaternion": [1, 0, 0, 0]}', "lacks height"),
    "long quaternion": (b'{"t": 1, "height": 1, "quaternion": [2, 0, 0, 0]}', "length 1"),
    "NaN": (b'{"t": 1, "height": NaN, "quaternion": [1, 0, 0, 0]}', "height must be a finite number, not nan"),
    "NaN within": (b'{"t": 1, "height": 1, "quaternion": [NaN, 0, 0, 0]}', "quaternion must be a finite number"),
    "time in words": (b'{"t": "now", "height": 1, "quaternion": [1, 0, 0, 0]}', "t must be"),
    "below the ground": (b'{"t": 1, "height": -1, "quaternion": [1, 0, 0, 0]}', "height"),
    "many digits": (b'{"t": 1, "height": ' + b"9" * 400 + b', "quaternion": [1, 0, 0, 0]}', "height"),
    "half a matrix": (b'{"t": 1, "Hoc": [[1, 0, 0, 0]]}', "Hoc must be a list of 4 values"),
    "a mirror": (b'{"Hoc": [[1,0,0,0],[0,1,0,0],[0,0,-1,1],[0,0,0,1]]}', "mirrors"),
    "both": (b'{"height": 1, "Hoc": []}', "not both"),
    "long": (b" " * (MAX_LINE_BYTES + 1), "more than"),
    "deep": (b"[" * 4000, "pose"),
    "bytes": (bytes(range(128, 256)), "JSON"),
}


@pytest.mark.parametrize(("line", "says"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_a_line_is_said(line, says):
    with pytest.raises(InputError, match=says):
        parse_pose_line(line)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=20,
)
LINES = (
    st.binary(max_size=200)
    | VALUES.map(lambda each: json.dumps(each).encode())
    | st.fixed_dictionaries(
        {},
        optional={
            "t": VALUES,
            "height": VALUES | st.floats(0.1, 3.0),
            "quaternion": VALUES | st.lists(st.floats(), min_size=4, max_size=4) | st.just([1, 0, 0, 0]),
            "Hoc": VALUES | st.lists(st.lists(st.floats(), min_size=4, max_size=4), min_size=4, max_size=4),
        },
    ).map(lambda each: json.dumps(each).encode())
)


@pytest.mark.slow
@settings(max_examples=2000)
@given(st.lists(LINES, min_size=5, max_size=5))
def test_ten_thousand_lines_of_anything_are_read_or_refused(lines):
    poses, refusals = PoseBuffer(PoseSettings()), []
    for line in lines:
        try:
            poses.add(time.monotonic(), parse_pose_line(line).orientation)
        except VisualMeshError as error:
            refusals.append(str(error))
    assert len(poses) + len(refusals) == len(lines)
    assert all("\n" not in each and len(each) < 400 for each in refusals)
