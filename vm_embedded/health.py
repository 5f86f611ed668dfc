"""What state a detector is in, and why: it is ok only while new frames come and are answered."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

_SHOWN = 0.5
"""Seconds for which a single trouble shows."""


@dataclass
class Health:
    """Told what happens, says how it is. Times in monotonic seconds.

    limit: without an answered frame for so long the detector is not ok [s].
    """

    limit: float
    stopping: bool = False
    answered: float = -math.inf
    """When the last frame was answered."""
    pose_trouble: str = ""
    """Why the last frame had no pose; nothing if it had one."""

    def __post_init__(self) -> None:
        self._troubles: deque[tuple[float, str]] = deque(maxlen=32)

    def trouble(self, now: float, what: str) -> None:
        """Something went wrong with a frame, a pose or a message."""
        self._troubles.append((now, what))

    def answer(self, now: float) -> None:
        """A fresh frame was answered."""
        self.answered = now
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
        return "ok", ""
