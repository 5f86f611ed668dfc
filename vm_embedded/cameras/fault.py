"""A camera that fails on purpose, by a script: to see what a robot's software makes of it.

source = "synthetic"                                # the camera that has the faults
faults = [{ kind = "hang", at = 5.0, seconds = 2.0 }]   # at: from when the camera was first opened [s]

[random]                                            # and more of them, one after another
count = 200
"""

from __future__ import annotations

import time
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..config.entries import check_entries, number
from ..config.sections import read_sections
from ..errors import InputError, unknown
from .camera import Camera, CameraError, Shot, decode_frame

KINDS = {
    "unplug": "reads fail, and so does opening",
    "hang": "a read does not come back",
    "frozen": "the same picture comes again and again",
    "truncated": "pictures end in the middle",
    "slow": "frames arrive long after they were taken",
    "resize": "pictures have other proportions",
    "ahead": "frames come from the future, as after a jump of the clock",
    "behind": "frames come from an hour ago",
}
"""What can go wrong."""

_LATE = 0.6
"""Seconds by which slow frames are late."""

_HOUR = 3600.0


@dataclass(frozen=True)
class Fault:
    """kind: of KINDS. at: when it begins, seconds: how long it takes [s]."""

    kind: str
    at: float
    seconds: float


@dataclass(frozen=True)
class RandomFaults:
    """Section [random]: faults one after another, as chance has it."""

    count: int = number(0, "faults", "", (0, 100000))
    seed: int = number(0, "decides which", "", (0, 2**31))
    first: float = number(2.0, "when the first one begins", "s", (0, 1e6))
    shortest: float = number(0.3, "shortest fault", "s", (0, 1e4))
    longest: float = number(1.0, "longest fault", "s", (0, 1e4))
    pause: float = number(1.0, "from the end of one to the next", "s", (0, 1e4))

    def __post_init__(self) -> None:
        check_entries(self)

    def drawn(self) -> Iterator[Fault]:
        """The faults, each kind as often as the others."""
        random = np.random.default_rng(self.seed)
        kinds = np.resize(list(KINDS), self.count)
        random.shuffle(kinds)
        at = self.first
        for kind in kinds.tolist():
            seconds = float(random.uniform(self.shortest, max(self.shortest, self.longest)))
            yield Fault(kind, at, seconds)
            at += seconds + self.pause


def _read_source(value: object) -> str:
    if not isinstance(value, str) or not value or value.startswith("fault:"):
        raise InputError(f"source must be the name of another camera, not {value!r}")
    return value


def _read_faults(value: object) -> tuple[Fault, ...]:
    if not isinstance(value, list):
        raise InputError(f"faults must be a list, not {value!r}")
    return tuple(_read_fault(each) for each in value)


def _read_fault(value: object) -> Fault:
    if not isinstance(value, Mapping) or set(value) != {"kind", "at", "seconds"}:
        raise InputError(f'a fault is like {{ kind = "hang", at = 5.0, seconds = 2.0 }}, not {value!r}')
    if value["kind"] not in KINDS:
        raise InputError(unknown("kind of fault", value["kind"], KINDS))
    times = [value["at"], value["seconds"]]
    if not all(isinstance(each, int | float) and not isinstance(each, bool) and 0 <= each < 1e6 for each in times):
        raise InputError(f"at and seconds of a fault must be numbers of at least 0 s, not {times}")
    return Fault(value["kind"], float(value["at"]), float(value["seconds"]))


@dataclass(frozen=True)
class FaultScript:
    """source: of the camera that has them."""

    source: str = field(default="synthetic", metadata={"read": _read_source})
    faults: tuple[Fault, ...] = field(default=(), metadata={"read": _read_faults})
    random: RandomFaults = field(default_factory=RandomFaults)

    @classmethod
    def read(cls, path: Path) -> FaultScript:
        """Read a script. Raises InputError."""
        script: FaultScript = read_sections(cls, path)
        return replace(script, faults=tuple(sorted((*script.faults, *script.random.drawn()), key=lambda each: each.at)))


class Faults:
    """The faults of a script as time goes by, from when the camera is first opened. One at a time: that which began
    last."""

    def __init__(self, script: FaultScript) -> None:
        self._faults = script.faults
        self._starts = [each.at for each in script.faults]
        self._began: float | None = None
        self.last: Shot | None = None
        """The last good shot; a frozen camera gives it again even when it is opened again."""

    def now(self) -> Fault | None:
        """The fault of this moment."""
        if self._began is None:
            self._began = time.monotonic()
        passed = time.monotonic() - self._began
        last = bisect_right(self._starts, passed) - 1
        fault = self._faults[last] if last >= 0 else None
        return fault if fault is not None and passed < fault.at + fault.seconds else None

    def left(self, fault: Fault) -> float:
        """How long a fault goes on [s]."""
        return max(fault.at + fault.seconds - (time.monotonic() - (self._began or 0.0)), 0.0)


class FaultCamera:
    """Another camera with faults. Raises CameraError while it is unplugged."""

    def __init__(self, faults: Faults, open_camera: Callable[[], Camera]) -> None:
        self._faults = faults
        _check_plugged(faults.now())
        self._camera = open_camera()

    def read(self) -> Shot | None:
        """The next shot of the other camera, or what the fault makes of it."""
        fault = self._faults.now()
        _check_plugged(fault)
        if fault is not None and fault.kind == "hang":
            time.sleep(self._faults.left(fault))
        shot = self._camera.read()
        if shot is None or fault is None:
            self._faults.last = shot
            return shot
        return self._spoilt(shot, fault.kind)

    def _spoilt(self, shot: Shot, kind: str) -> Shot:
        truth: dict[str, Any] = {**shot.truth, "fault": kind}
        if kind == "frozen" and self._faults.last is not None:
            return replace(shot, image=self._faults.last.image, truth=truth)
        if kind == "truncated":
            content = cv2.imencode(".jpg", shot.image)[1].tobytes()
            return replace(shot, image=decode_frame(content[: len(content) // 2]), truth=truth)
        if kind == "slow":
            time.sleep(_LATE)
        if kind == "resize":
            return replace(shot, image=np.ascontiguousarray(shot.image[: shot.image.shape[0] // 2]), truth=truth)
        jump = {"ahead": _HOUR, "behind": -_HOUR}.get(kind, 0.0)
        return replace(shot, captured=shot.captured + jump, truth=truth)

    def close(self) -> None:
        """Close the other camera."""
        self._camera.close()


def _check_plugged(fault: Fault | None) -> None:
    if fault is not None and fault.kind == "unplug":
        raise CameraError("camera is unplugged, as the script says")
