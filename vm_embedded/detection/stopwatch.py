"""The time that each stage of a frame takes."""

from __future__ import annotations

from time import perf_counter


class Stopwatch:
    """Milliseconds of each stage, in the order in which the stages ended. It starts when it is made."""

    def __init__(self) -> None:
        self.stages: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, stage: str) -> None:
        """End a stage: its time is that since the stage before ended."""
        now = perf_counter()
        self.stages[stage] = 1e3 * (now - self._last)
        self._last = now
