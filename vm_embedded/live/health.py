"""What state a detector is in, and why: it is ok only while new frames come and are answered."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from statistics import median

_SHOWN = 0.5
"""Seconds for which a single trouble shows."""

_TIMED = 15
"""Frames whose median latency must be within the budget. Before there are as many it is not ok: who asks three times in
two seconds would take a network of five frames a second for one that is fast enough."""


@dataclass
class Health:
    """Told what happens, says how it is. Times in monotonic seconds.

    limit: without an answered frame for so long the detector is not ok [s].
    budget: so long may frames wait for their answer [s]; infinite for any time.
    """

    limit: float
    budget: float = math.inf
    stopping: bool = False
    answered: float = -math.inf
    """When the last frame was answered."""
    pose_trouble: str = ""
    """Why the last frame had no pose; nothing if it had one."""

    def __post_init__(self) -> None:
        self._troubles: deque[tuple[float, str]] = deque(maxlen=32)
        self._latencies: deque[float] = deque(maxlen=_TIMED)

    def trouble(self, now: float, what: str) -> None:
        """Something went wrong with a frame, a pose or a message."""
        self._troubles.append((now, what))

    def answer(self, now: float, latency: float) -> None:
        """A fresh frame was answered, so long after its arrival [s]."""
        self.answered = now
        self._latencies.append(latency)
        self.pose_trouble = ""

    def state(self, now: float, camera_lost: bool, camera_trouble: str) -> tuple[str, str]:
        """The state, of messages.STATES, and the reason."""
        while self._troubles and now - self._troubles[0][0] > _SHOWN:
            self._troubles.popleft()
        if self.stopping:
            return "stopping", ""
        if camera_lost:
            if self.answered == -math.inf and not camera_trouble:
                return "starting", "waiting for the first frame"
            return "camera_lost", camera_trouble
        if self.pose_trouble:
            return "pose_stale", self.pose_trouble
        if now - self.answered > self.limit:
            if self.answered == -math.inf and not self._troubles:
                return "starting", "waiting for the first frame"
            last = self._troubles[-1][1] if self._troubles else camera_trouble
            return "degraded", last or "no frame was answered in time"
        if self._troubles:
            return "degraded", self._troubles[-1][1]
        if self.budget < math.inf:
            if len(self._latencies) < _TIMED:
                return "starting", f"timing the first {_TIMED} frames"
            if (latency := median(self._latencies)) > self.budget:
                return "degraded", f"frames take {1e3 * latency:.1f} ms, the budget is {1e3 * self.budget:g} ms"
        return "ok", ""
