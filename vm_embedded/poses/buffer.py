"""The robot's poses of the last seconds, and the pose at the time of a frame.

All times are seconds of the monotonic clock, as time.monotonic() returns them.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque

import cv2
import numpy as np

from ..arrays import Floats
from ..errors import GeometryError, VisualMeshError
from ..geometry.orientation import Orientation
from .settings import PoseSettings

_KEPT = 3.0
"""How long poses are kept [s]; every frame is newer."""

_MIN_INTERVAL = 0.005
"""Least time between two poses that a speed is computed from [s]: lines that waited together arrive at one moment."""


class StalePoseError(VisualMeshError):
    """No pose is near enough to the time of a frame."""


class PoseBuffer:
    """The poses of the last seconds, in the order of their times."""

    def __init__(self, settings: PoseSettings) -> None:
        self.settings = settings
        self._poses: deque[tuple[float, Orientation]] = deque()

    def __len__(self) -> int:
        return len(self._poses)

    @property
    def newest(self) -> float:
        """Time of the newest pose [s]; minus infinity if there is none."""
        return self._poses[-1][0] if self._poses else -math.inf

    def add(self, time: float, orientation: Orientation) -> None:
        """Add a pose that is newer than the last one.

        Raises GeometryError if it is not newer, or if it jumps: height or gravity changes faster than the settings
        allow. Once the last pose is stale, the next one is accepted anyway: the robot may have been carried.
        """
        self._check(time, orientation)
        self._poses.append((time, orientation))
        while time - self._poses[0][0] > _KEPT:
            self._poses.popleft()

    def _check(self, time: float, orientation: Orientation) -> None:
        """Raise GeometryError for a pose that `add` rejects; clear the buffer where the poses start anew."""
        if not self._poses:
            return
        last, before = self._poses[-1]
        elapsed = time - last
        if elapsed <= 0.0:
            if elapsed < -_KEPT:  # the clock of the poses was set back
                self._poses.clear()
                return
            raise GeometryError(f"pose at {time:.3f} s is not newer than the last one, at {last:.3f} s")
        if elapsed > 1e-3 * self.settings.max_age_ms:
            self._poses.clear()
            return
        elapsed = max(elapsed, _MIN_INTERVAL)
        climb = abs(orientation.height - before.height)
        if climb > self.settings.max_climb * elapsed:
            raise GeometryError(
                f"height jumps by {climb:.3f} m in {1e3 * elapsed:.1f} ms, faster than {self.settings.max_climb:g} m/s"
            )
        turn = math.acos(float(np.clip(orientation.rotation[2] @ before.rotation[2], -1.0, 1.0)))
        if turn > self.settings.max_turn * elapsed:
            raise GeometryError(
                f"gravity turns by {turn:.3f} rad in {1e3 * elapsed:.1f} ms, faster than "
                f"{self.settings.max_turn:g} rad/s"
            )

    def at(self, time: float) -> Orientation:
        """The interpolated orientation at a time [s].

        Raises StalePoseError if no pose is near enough.
        """
        if not self._poses:
            raise StalePoseError("no pose received yet")
        ahead = time - self.newest
        if ahead > 1e-3 * self.settings.max_age_ms:
            raise StalePoseError(f"newest pose is {1e3 * ahead:.0f} ms older than the frame")
        times = [each[0] for each in self._poses]
        if time < times[0] - 1e-3 * self.settings.max_age_ms:
            raise StalePoseError(f"oldest pose is {1e3 * (times[0] - time):.0f} ms newer than the frame")
        if len(self._poses) == 1:
            return self._poses[-1][1]
        if time > times[-1]:
            return self._extrapolated(times, min(time - times[-1], 1e-3 * self.settings.extrapolate_ms))
        after = max(bisect_right(times, time), 1)
        if after == len(times):
            return self._poses[-1][1]
        (start, one), (end, other) = self._poses[after - 1], self._poses[after]
        return interpolate(one, other, (max(time, start) - start) / (end - start))

    def _extrapolated(self, times: list[float], ahead: float) -> Orientation:
        """The orientation at a time `ahead` [s] after the newest pose, with the speed of the last _MIN_INTERVAL or
        more."""
        start = max(bisect_right(times, times[-1] - _MIN_INTERVAL) - 1, 0)
        elapsed = max(times[-1] - times[start], _MIN_INTERVAL)
        return interpolate(self._poses[start][1], self._poses[-1][1], 1.0 + ahead / elapsed)


def interpolate(one: Orientation, other: Orientation, share: float) -> Orientation:
    """The orientation at a share of the way from one to the other; shares above 1 extrapolate.

    The height changes linearly and stays positive; the rotation follows the shortest arc (slerp).
    """
    rotation = interpolate_rotation(one.rotation, other.rotation, share)
    return Orientation(max(one.height + share * (other.height - one.height), 1e-3), rotation)


def interpolate_rotation(one: Floats, other: Floats, share: float) -> Floats:
    """The rotation (3, 3) at a share of the shortest way from one to the other; shares above 1 extrapolate."""
    turn = cv2.Rodrigues(one.T @ other)[0]
    return np.asarray(one @ cv2.Rodrigues(share * turn)[0], dtype=np.float64)
