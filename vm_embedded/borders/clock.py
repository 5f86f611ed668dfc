"""The wall clock beside the monotonic clock."""

from __future__ import annotations

import time

_READINGS = 5


def wall_offset() -> float:
    """The wall clock relative to the monotonic clock [s].

    A process may lose the processor between the readings of two clocks, for milliseconds. So the quickest of several
    pairs counts.
    """
    pairs = []
    for _ in range(_READINGS):
        before, wall, after = time.monotonic(), time.time(), time.monotonic()
        pairs.append((after - before, wall - 0.5 * (before + after)))
    return min(pairs)[1]
