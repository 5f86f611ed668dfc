"""The clock of stamps."""

import math
import time

from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.borders import clock
from vm_embedded.borders.clock import wall_offset
from vm_embedded.cameras.ros import stamps
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
    own = StampClock("arrival")
    assert math.isclose(own.monotonic(1000.0, 50.3), 50.3)
    assert math.isclose(own.monotonic(1000.1, 50.31), 50.31)  # a shorter delay
    assert math.isclose(own.monotonic(1000.2, 50.6), 50.41)  # a longer one does not count
    assert math.isclose(own.monotonic(1000.0, 53.0), 53.0)  # the bag starts anew


def test_equal_stamps_have_equal_times_until_the_clock_is_set(monkeypatch):
    own, offset = StampClock("wall"), 1.7e9
    monkeypatch.setattr(stamps, "wall_offset", lambda: offset)
    first = own.monotonic(offset + 7.0, 8.0)
    offset += 5e-4  # a process that lost the processor between two readings, or a clock that is slewed
    assert own.monotonic(1.7e9 + 7.0, 8.0) == first == 7.0
    offset += 0.5
    assert math.isclose(own.monotonic(1.7e9 + 7.0, 8.0), 6.4995, abs_tol=1e-6)


def test_the_offset_of_the_wall_clock_is_read_between_pauses(monkeypatch):
    """Three of five pairs of readings are torn apart."""
    ticks = iter([0.0, 0.3, 0.3, 0.3, 0.3, 0.8, 0.8, 0.8, 0.8001, 0.8001, 0.8002, 0.8002, 0.9, 0.9, 1.4])
    monkeypatch.setattr(clock.time, "monotonic", lambda: next(ticks))
    monkeypatch.setattr(clock.time, "time", lambda: 100.0 + next(ticks))
    assert math.isclose(wall_offset(), 100.0, abs_tol=1e-4)
