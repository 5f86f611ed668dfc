"""Stamps of ROS messages, and the clock that they are read from."""

from __future__ import annotations

import math
from typing import Any

from ...borders.clock import wall_offset

_JUMP = 1.0
"""Change between the clock of the stamps and the own clock [s] after which the stamps start anew, as in a bag that is
played again."""

_DRIFT = 1e-3
"""Change between the wall clock and the monotonic clock [s] that the stamps follow. Below it, equal stamps keep equal
times: an image and its pose, which arrive one after the other, belong together."""


def seconds_of(stamp: Any) -> float:
    """The seconds of a builtin_interfaces/Time."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def stamp_of(types: Any, seconds: float) -> Any:
    """The builtin_interfaces/Time of seconds since 1970, in a set of message types."""
    whole, rest = divmod(round(1e9 * seconds), 10**9)
    return types.Time(sec=whole, nanosec=rest)


class StampClock:
    """Turns stamps into monotonic time [s].

    wall: stamps are seconds since 1970. arrival: they are of another clock. The message with the smallest delay so far
    then counts as sent without delay.
    """

    def __init__(self, clock: str) -> None:
        self._wall = clock == "wall"
        self._offset = math.nan

    def monotonic(self, seconds: float, now: float) -> float:
        """The monotonic time of a stamp of a message that arrives at `now`, both in seconds."""
        if self._wall:
            self._follow(-wall_offset(), _DRIFT)
        else:
            self._follow(now - seconds, _JUMP)
            self._offset = min(self._offset, now - seconds)
        return seconds + self._offset

    def _follow(self, offset: float, jump: float) -> None:
        if not abs(offset - self._offset) <= jump:  # nan at first
            self._offset = offset
