"""Where the camera was at the moment of a frame: the robot's own poses, kept for a while and interpolated.

Times are seconds of the monotonic clock, as time.monotonic() gives them.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from dataclasses import Field, dataclass
from typing import Any

import cv2
import numpy as np

from ..arrays import Floats
from ..config.entries import check_entries, entry, number, one_of, switch
from ..errors import GeometryError, InputError, VisualMeshError
from ..geometry.orientation import Orientation
from ..sockets import parse_address

CLOCKS = ("monotonic", "wall", "arrival")
FRAMES = ("camera", "optical")

_KEPT = 3.0
"""Seconds of poses that are kept; no frame is that old."""

_SHORTEST = 0.005
"""Seconds between two poses at least, as far as jumps go: lines that wait together arrive at one moment."""


class StalePoseError(VisualMeshError):
    """There is no pose for the moment of a frame."""


def _source(entry: Field[Any], value: object) -> str:
    kind, _, rest = value.partition(":") if isinstance(value, str) else ("", "", "")
    if kind == "udp":
        parse_address(rest, "source udp:ADDRESS:PORT")
    elif not (value in ("fixed", "stdin") or (kind == "unix" and rest)):
        raise InputError(f"source must be fixed, stdin, unix:PATH or udp:ADDRESS:PORT, not {value!r}")
    return str(value)


@dataclass(frozen=True, kw_only=True)
class PoseSettings:
    """Section [pose]: where poses come from, and how far they are trusted."""

    source: str = entry(
        _source,
        "fixed",
        "fixed: as [orientation] says; or lines of JSON from stdin, from unix:PATH, a socket that is made there, or "
        "from udp:ADDRESS:PORT",
    )
    clock: str = one_of(
        CLOCKS,
        "monotonic",
        "what t counts in: the machine's monotonic clock, its wall clock, or arrival: the moment when the line arrives "
        "counts instead",
    )
    frame: str = one_of(
        FRAMES,
        "camera",
        "what is turned: camera, x forward and y left; optical, as OpenCV's and ROS's, z forward and x right",
    )
    latency_ms: float = number(0.0, "how much earlier than its t a pose was true", "ms", (-1000, 1000))
    wait_ms: float = number(40.0, "how long a frame waits for a pose as new as itself", "ms", (0, 1000))
    interpolate: bool = switch(True, "take the pose of the frame's moment between two others, not the newest one")
    extrapolate_ms: float = number(5.0, "how far the motion goes on behind the newest pose", "ms", (0, 100))
    max_age_ms: float = number(100.0, "how much older than the frame the newest pose may be", "ms", (1, 10000))
    max_climb: float = number(5.0, "height that changes faster is a jump, which is refused", "m/s", (0.01, 1000))
    max_turn: float = number(30.0, "gravity that turns faster is a jump, which is refused", "rad/s", (0.1, 1000))

    def __post_init__(self) -> None:
        check_entries(self)


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
        """Keep a pose.

        Raises GeometryError for one that is not newer than the last, or that jumps. If no other comes before the last
        is stale, the next one is taken as it is: the robot was carried, or its sensors began anew.
        """
        self._check(time, orientation)
        self._poses.append((time, orientation))
        while time - self._poses[0][0] > _KEPT:
            self._poses.popleft()

    def _check(self, time: float, orientation: Orientation) -> None:
        if not self._poses:
            return
        last, before = self._poses[-1]
        elapsed = time - last
        if elapsed <= 0.0:
            if elapsed < -_KEPT:  # the clock of the poses was set back
                self._poses.clear()
                return
            raise GeometryError(f"pose of {time:.3f} s is not newer than the last one, {last:.3f} s")
        if elapsed > 1e-3 * self.settings.max_age_ms:
            self._poses.clear()
            return
        elapsed = max(elapsed, _SHORTEST)
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
        """The orientation at a time [s]. Raises StalePoseError if no pose is near enough."""
        if not self._poses:
            raise StalePoseError("no pose has come yet")
        ahead = time - self.newest
        if ahead > 1e-3 * self.settings.max_age_ms:
            raise StalePoseError(f"newest pose is {1e3 * ahead:.0f} ms older than the frame")
        times = [each[0] for each in self._poses]
        if time < times[0] - 1e-3 * self.settings.max_age_ms:
            raise StalePoseError(f"oldest pose is {1e3 * (times[0] - time):.0f} ms newer than the frame")
        if not self.settings.interpolate or len(self._poses) == 1:
            return self._poses[-1][1]
        time = min(max(time, times[0]), times[-1] + 1e-3 * self.settings.extrapolate_ms)
        after = min(max(bisect_right(times, time), 1), len(times) - 1)
        (start, one), (end, other) = self._poses[after - 1], self._poses[after]
        return interpolate(one, other, (time - start) / (end - start))


def interpolate(one: Orientation, other: Orientation, share: float) -> Orientation:
    """The orientation on the straight way from one to another, slerp; shares above 1 go on beyond it."""
    turn = cv2.Rodrigues(one.rotation.T @ other.rotation)[0]
    rotation: Floats = one.rotation @ cv2.Rodrigues(share * turn)[0]
    return Orientation(max(one.height + share * (other.height - one.height), 1e-3), rotation)
