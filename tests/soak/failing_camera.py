"""vm-detect with a synthetic camera that fails on purpose.

`python failing_camera.py FAULTS ...` runs vm-detect with the options that follow; FAULTS is a list in JSON of faults:
kind, start since the camera was first opened [s], and length [s].
"""

from __future__ import annotations

import json
import sys
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any

import cv2
import numpy as np

from vm_embedded.cameras import open_camera
from vm_embedded.cameras.camera import Camera, CameraError, Shot
from vm_embedded.cameras.decoding import decode_frame

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


def command(faults: Sequence[Fault]) -> list[str]:
    """The command that runs vm-detect with such a camera, for its options to follow."""
    return [sys.executable, __file__, json.dumps([astuple(each) for each in faults])]


class Faults:
    """Tells which of some faults is active, given in the order of their start. Time starts when the camera is first
    opened; if faults overlap, only the last one is active."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        self._faults = faults
        self._starts = [each.at for each in faults]
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


class FailingCamera:
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
        raise CameraError("camera is unplugged by a fault")


def main(arguments: Sequence[str]) -> int:
    """Run vm-detect with faults, and return its exit status."""
    from vm_embedded.cli.detect import main as detect

    faults = Faults([Fault(*each) for each in json.loads(arguments[0])])
    synthetic = open_camera.SyntheticCamera
    open_camera.SyntheticCamera = lambda settings: FailingCamera(faults, lambda: synthetic(settings))  # type: ignore
    return detect(["--camera", "synthetic", *arguments[1:]])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
