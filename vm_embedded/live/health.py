"""Determine the state of a detector and the reason: it is ok only while new frames arrive and are answered."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from statistics import median

_TROUBLE_LASTS = 0.5
"""How long a single trouble degrades the state [s]."""

_TIMED = 15
"""Number of frames whose median latency must be within the budget. Until there are as many, the state is `starting`:
vm-deploy, which asks three times in two seconds, can't accept a network because of its first few frames."""


@dataclass
class Health:
    """Collects events and gives the state. All times are monotonic [s].

    limit: time without an answered frame after which the detector is not ok [s].
    budget: longest median latency of frames [s]; infinite for no limit.
    """

    limit: float
    budget: float = math.inf
    stopping: bool = False
    answered: float = -math.inf
    """When the last frame was answered."""
    pose_trouble: str = ""
    """Why the last frame had no pose; empty if it had one."""

    def __post_init__(self) -> None:
        self._troubles: deque[tuple[float, str]] = deque(maxlen=32)
        self._latencies: deque[float] = deque(maxlen=_TIMED)

    def add_trouble(self, now: float, reason: str) -> None:
        """Note that something is wrong with a frame, a pose or an output."""
        self._troubles.append((now, reason))

    def add_answer(self, now: float, latency: float) -> None:
        """Note that a frame was answered, `latency` after its arrival [s]."""
        self.answered = now
        self._latencies.append(latency)

    def state(self, now: float, camera_lost: bool, camera_trouble: str) -> tuple[str, str]:
        """The state, one of messages.STATES, and the reason."""
        while self._troubles and now - self._troubles[0][0] > _TROUBLE_LASTS:
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
                return "degraded", f"frames take {1e3 * latency:.1f} ms, but the budget is {1e3 * self.budget:g} ms"
        return "ok", ""
