"""The clock of stamps."""

import math
import time

from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.cameras.ros.stamps import StampClock, seconds_of, stamp_of

from .rolling_ball import TYPES


@given(st.integers(0, 2**31 - 1), st.integers(0, 10**9 - 1))
def test_a_stamp_survives_as_seconds(whole, rest):
    seconds = seconds_of(TYPES.Time(sec=whole, nanosec=rest))
    stamp = stamp_of(TYPES, seconds)
    assert 0 <= stamp.nanosec < 10**9
    assert abs((stamp.sec - whole) + 1e-9 * (stamp.nanosec - rest)) < 1e-6


def test_stamps_of_the_wall_clock_become_monotonic():
    now = time.monotonic()
    assert math.isclose(StampClock("wall").monotonic(time.time() - 0.5, now), now - 0.5, abs_tol=0.2)


def test_stamps_of_another_clock_count_from_the_fastest_message():
    clock = StampClock("arrival")
    assert math.isclose(clock.monotonic(1000.0, 50.3), 50.3)
    assert math.isclose(clock.monotonic(1000.1, 50.31), 50.31)  # a shorter delay
    assert math.isclose(clock.monotonic(1000.2, 50.6), 50.41)  # a longer one does not count
    assert math.isclose(clock.monotonic(1000.0, 53.0), 53.0)  # the bag starts anew
