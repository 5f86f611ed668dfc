"""Poses are kept for a while, and interpolated at the time of a frame."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import GeometryError
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.poses.buffer import PoseBuffer, StalePoseError, interpolate
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


@given(st.floats(1e-6, 4e-3), st.floats(0.0, 0.05))
def test_poses_that_arrived_together_do_not_give_a_wild_speed(apart, ahead):
    """The speed is that since an older pose; without one, the two may be five milliseconds apart."""
    poses = PoseBuffer(PoseSettings(max_age_ms=200.0, extrapolate_ms=50.0))
    for at, pitch in ((1.0, 0.30), (1.08, 0.34), (1.08 + apart, 0.342)):
        poses.add(at, Orientation.from_roll_pitch(0.6, 0.0, pitch))
    assert poses.at(1.08 + apart + ahead).pitch == pytest.approx(0.342 + 0.042 / 0.08 * ahead, abs=2e-3)
    poses = PoseBuffer(PoseSettings(max_age_ms=200.0, extrapolate_ms=50.0))
    for at, pitch in ((1.0, 0.30), (1.0 + apart, 0.302)):
        poses.add(at, Orientation.from_roll_pitch(0.6, 0.0, pitch))
    assert poses.at(1.0 + apart + ahead).pitch <= 0.302 + 0.002 / 0.005 * ahead + 1e-6
