"""When a frame of a stream was taken: after a network stall, or after the process was stopped, frames arrive late.

All times are monotonic [s], except the server's stamps.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median

_DRIFT = 2e-4
"""How much faster the server's clock may be than ours."""

_LARGEST_STAMP = 1e11
"""A larger one can't be in seconds."""

_OLDEST = 5.0
"""Largest delay after a stamp that is trusted [s]; beyond it, the server's clock was changed."""

_SLOW, _FAST = 0.1, 1 / 120
"""Longest and shortest period of the frames that is assumed while the real one is unknown [s]."""

_KNOWN, _REMEMBERED = 3, 15
"""Intervals between frames after which their median counts as the period, and that are remembered."""

_SHORTEST = 0.9
"""Least time between two frames [periods]: the period is known only roughly, and no frame may count as too new."""

_STALL = 0.05
"""Delay of a frame that is more than jitter [s]."""

_READY = 0.003
"""A reader that waits less for a frame found it ready [s]."""

_BURST, _CALM = 0.9, 2
"""A shorter interval [shortest periods] is of a burst; after so many longer ones in a row, no frame waits anymore."""


class FrameClock:
    """Tells when each frame of a stream was taken, at the latest by a constant delay after the truth.

    With stamps of the server, the fastest delivery so far gives the difference of the two clocks. Without them, the
    rate tells: if a frame comes late, it and those that follow in a burst may have waited. Each of them is as old as it
    can be: it was taken one period after the one before.

    begun: when the connection was opened, for a reader that lets frames wait until it knows the stream [s].
    """

    def __init__(self, begun: float = math.nan) -> None:
        self._intervals: deque[float] = deque(maxlen=_REMEMBERED)
        self._arrived = self._taken = begun  # of the last frame
        self._calm = _CALM  # intervals in a row that were not of a burst
        self._stamp = -math.inf
        self._offset = math.inf  # of our clock to the server's, for the fastest delivery

    def taken(self, arrived: float, stamp: float | None = None, waited: float = math.inf) -> float:
        """When the next frame was taken.

        arrived: when it arrived. stamp: the server's time of the frame, if any [s]. waited: how long the reader waited
        for it, if that is known [s].
        """
        self._taken = self._by_rate(arrived, waited < _READY)
        if stamp is not None and abs(stamp) < _LARGEST_STAMP:
            self._taken = self._by_stamp(arrived, stamp, self._taken)
        return self._taken

    def _by_rate(self, arrived: float, was_ready: bool) -> float:
        """was_ready: the frame had arrived before somebody read it."""
        interval, self._arrived = arrived - self._arrived, arrived
        if math.isnan(interval):
            return arrived
        if len(self._intervals) >= _KNOWN:
            longest = median(self._intervals)
            shortest = _SHORTEST * longest
        else:
            longest, shortest = _SLOW, _FAST
        is_burst = interval < _BURST * shortest or was_ready
        if not is_burst or self._calm >= _CALM:
            self._intervals.append(interval)
        if interval > longest + _STALL:
            self._calm = 0
        elif self._calm < _CALM:
            self._calm = 0 if is_burst else self._calm + 1
        earliest = self._taken + shortest
        if self._calm >= _CALM or earliest >= arrived:
            self._calm = _CALM
            return arrived
        return earliest

    def _by_stamp(self, arrived: float, stamp: float, by_rate: float) -> float:
        if stamp <= self._stamp or arrived - stamp > self._offset + _OLDEST:
            self._offset = by_rate - stamp  # the server's clock was changed, or the stall was very long
        elif self._offset < math.inf:
            self._offset += _DRIFT * (stamp - self._stamp)
        self._offset = min(self._offset, arrived - stamp)
        self._stamp = stamp
        return min(stamp + self._offset, arrived)
