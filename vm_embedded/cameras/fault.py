"""A camera that fails on purpose, to test how a robot's software reacts. A script lists its faults:

source = "synthetic"                                    # the camera to which faults are added
faults = [{ kind = "hang", at = 5.0, seconds = 2.0 }]   # at: time since the camera was first opened [s]

[random]                                                # adds random faults, one after another
count = 200
"""

from __future__ import annotations

import time
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..arrays import number_or_nan
from ..config.entries import check_entries, number
from ..config.sections import read_sections
from ..errors import InputError, unknown
from .camera import Camera, CameraError, Shot
from .decoding import decode_frame

KINDS = {
    "unplug": "reading and opening fail",
    "hang": "a read does not return",
    "frozen": "the same image repeats",
    "truncated": "images end in the middle",
    "slow": "frames arrive long after they were taken",
    "burst": "frames wait until the fault ends, then arrive at once",
    "resize": "images have another size",
    "empty": "images have no pixels",
    "blank": "images have a single color",
    "depth": "images have 16 bits for each channel",
    "ahead": "timestamps are an hour in the future, as after a clock jump",
    "behind": "timestamps are an hour in the past",
}
"""All kinds of faults."""

_SLOW = 0.6
"""Delay of slow frames [s]."""

_JUMP = 3600.0
"""Error of the timestamps of frames ahead and behind [s]."""

_WAITING = 30
"""Most frames that wait for the end of a burst; the oldest are lost."""

_BLANK = 128
"""Gray value of blank images."""


@dataclass(frozen=True)
class Fault:
    """One fault. kind: one of KINDS. at: when it starts [s]. seconds: how long it lasts [s]."""

    kind: str
    at: float
    seconds: float


@dataclass(frozen=True)
class RandomFaults:
    """Section [random]: random faults, one after another."""

    count: int = number(0, "number of random faults", "", (0, 100000))
    seed: int = number(0, "seed of the random numbers", "", (0, 2**31))
    first: float = number(2.0, "start of the first fault", "s", (0, 1e6))
    shortest: float = number(0.3, "shortest fault", "s", (0, 1e4))
    longest: float = number(1.0, "longest fault", "s", (0, 1e4))
    pause: float = number(1.0, "pause between two faults", "s", (0, 1e4))

    def __post_init__(self) -> None:
        check_entries(self)

    def draw(self) -> Iterator[Fault]:
        """Draw the faults; all kinds are equally frequent."""
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
        raise InputError(f'write a fault like {{ kind = "hang", at = 5.0, seconds = 2.0 }}, not {value!r}')
    if value["kind"] not in KINDS:
        raise InputError(unknown("kind of fault", value["kind"], KINDS))
    given = [value["at"], value["seconds"]]
    at, seconds = map(number_or_nan, given)
    if not (0.0 <= at < 1e6 and 0.0 <= seconds < 1e6):
        raise InputError(f"at and seconds of a fault must be numbers from 0 s to 1e6 s, not {given}")
    return Fault(value["kind"], at, seconds)


@dataclass(frozen=True)
class FaultScript:
    """The source of the camera to which faults are added, and its faults in the order of their start."""

    source: str = field(default="synthetic", metadata={"read": _read_source})
    faults: tuple[Fault, ...] = field(default=(), metadata={"read": _read_faults})
    random: RandomFaults = field(default_factory=RandomFaults)

    @classmethod
    def read(cls, path: Path) -> FaultScript:
        """Read a script. Raises InputError."""
        script: FaultScript = read_sections(cls, path, noun="fault script")
        return replace(script, faults=tuple(sorted((*script.faults, *script.random.draw()), key=lambda each: each.at)))


class Faults:
    """Tells which fault of a script is active. Time starts when the camera is first opened; if faults overlap, only the
    last one is active."""

    def __init__(self, script: FaultScript) -> None:
        self._faults = script.faults
        self._starts = [each.at for each in script.faults]
        self._began: float | None = None
        self.last: Shot | None = None
        """The last good shot, which a frozen camera repeats even after it was opened again."""
        self.waiting: deque[Shot] = deque(maxlen=_WAITING)
        """The shots of a burst that wait for its end, the oldest first."""

    def now(self) -> Fault | None:
        """The active fault, or None."""
        if self._began is None:
            self._began = time.monotonic()
        passed = time.monotonic() - self._began
        last = bisect_right(self._starts, passed) - 1
        fault = self._faults[last] if last >= 0 else None
        return fault if fault is not None and passed < fault.at + fault.seconds else None

    def remaining(self, fault: Fault) -> float:
        """How much longer a fault lasts [s]."""
        return max(fault.at + fault.seconds - (time.monotonic() - (self._began or 0.0)), 0.0)


class FaultCamera:
    """Another camera with faults. Raises CameraError while it is unplugged."""

    def __init__(self, faults: Faults, open_camera: Callable[[], Camera]) -> None:
        self._faults = faults
        _check_plugged(faults.now())
        self._camera = open_camera()

    def read(self) -> Shot | None:
        """Return the next shot of the other camera, with the active fault applied."""
        fault = self._faults.now()
        _check_plugged(fault)
        if fault is not None and fault.kind == "hang":
            time.sleep(self._faults.remaining(fault))
        while fault is not None and fault.kind == "burst":
            self._wait(self._camera.read())
            fault = self._faults.now()
        if self._faults.waiting:
            return self._faults.waiting.popleft()
        shot = self._camera.read()
        if shot is None or fault is None:
            self._faults.last = shot
            return shot
        return self._apply(fault.kind, shot)

    def _wait(self, shot: Shot | None) -> None:
        if shot is not None:
            self._faults.waiting.append(_marked(shot, "burst"))

    def _apply(self, kind: str, shot: Shot) -> Shot:
        shot = _marked(shot, kind)
        if kind == "frozen" and self._faults.last is not None:
            return replace(shot, image=self._faults.last.image)
        if kind == "truncated":
            content = cv2.imencode(".jpg", shot.image)[1].tobytes()
            return replace(shot, image=decode_frame(content[: len(content) // 2]))
        if kind == "slow":
            time.sleep(_SLOW)
        if kind == "resize":
            return replace(shot, image=np.ascontiguousarray(shot.image[: shot.image.shape[0] // 2]))
        if kind == "empty":
            return replace(shot, image=shot.image[:0, :0])
        if kind == "blank":
            return replace(shot, image=np.full_like(shot.image, _BLANK))
        if kind == "depth":
            wrong: Any = shot.image.astype(np.uint16) << 8
            return replace(shot, image=wrong)
        jump = {"ahead": _JUMP, "behind": -_JUMP}.get(kind, 0.0)
        return replace(shot, captured=shot.captured + jump)

    def close(self) -> None:
        """Close the other camera."""
        self._camera.close()


def _marked(shot: Shot, kind: str) -> Shot:
    """The shot, with the kind of its fault in its truth."""
    return replace(shot, truth={**shot.truth, "fault": kind})


def _check_plugged(fault: Fault | None) -> None:
    if fault is not None and fault.kind == "unplug":
        raise CameraError("camera is unplugged by the fault script")
