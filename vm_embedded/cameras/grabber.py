"""Read a camera in a thread and keep only its newest frame.

A camera that delivers no new frame in time is lost. The grabber then abandons the reading thread, however long its read
hangs, and starts another thread that opens the camera again, after pauses that double. It ignores everything that an
abandoned thread delivers.
"""

from __future__ import annotations

import ctypes
import math
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..arrays import Image
from ..errors import VisualMeshError, one_line
from .camera import EARLY, BrokenFrameError, Camera, CameraSettings, Shot
from .open_camera import Opener

MOST_HANGING = 8
"""Largest number of hanging threads; beyond it, only a new process helps."""

_M_ARENA_MAX, _ARENAS = -8, 2
"""Parameter of glibc's mallopt, and the arenas from which threads get memory: one for the first, one for all others."""


@dataclass
class CameraCounts:
    """Counts of frames by their outcome, and of reconnects.

    grabbed: new frames. skipped: replaced by a newer frame before they were taken. broken, frozen (identical to the one
    before) and ahead (from the future) were rejected. reconnects: how often the camera was opened again.
    """

    grabbed: int = 0
    skipped: int = 0
    broken: int = 0
    frozen: int = 0
    ahead: int = 0
    reconnects: int = 0

    @property
    def rejected(self) -> int:
        """Frames that were not used because something was wrong with them."""
        return self.broken + self.frozen + self.ahead


class Grabber:
    """Holds the newest shot of a camera.

    wake: called in another thread whenever there is a shot or the camera has failed.
    """

    def __init__(self, opener: Opener, settings: CameraSettings, wake: Callable[[], None]) -> None:
        self.settings = settings
        self.counts = CameraCounts()
        self.trouble = ""
        """The last problem of the camera."""
        self.ended = False
        """Whether the camera has reached its end, as files do."""
        self._opener = opener
        self._wake = wake
        self._lock = threading.Lock()
        self._newest: Shot | None = None
        self._image: Image | None = None  # of the last new frame, kept when the camera is opened again
        self._fresh = -math.inf  # when the last new frame arrived
        self._opened = 0.0  # when the last attempt to open the camera started
        self._retry = 0.0  # when to try again, if there is no reader
        self._pause = 1e-3 * settings.retry_ms
        self._reader: _Reader | None = None
        self._abandoned: list[_Reader] = []
        self._refused = ""  # why the system gives no thread; empty if it does
        _share_arenas()

    def start(self) -> None:
        """Open the camera, unless the system gives no thread: see `stuck`."""
        self._opened = time.monotonic()
        self._reader = _Reader(self, self._opener)
        try:
            self._reader.start()
        except RuntimeError as error:
            self._refused, self._reader = str(error), None

    def take(self) -> Shot | None:
        """Return the newest shot, or None if it was taken before."""
        with self._lock:
            shot, self._newest = self._newest, None
        return shot

    @property
    def has_shot(self) -> bool:
        """Whether there is a shot to take."""
        return self._newest is not None

    @property
    def stuck(self) -> str:
        """Why the camera needs a new process; empty if it does not."""
        if self._refused:
            return f"the camera can't be opened: {self._refused}"
        return f"{MOST_HANGING} reads of the camera hang" if self.hanging >= MOST_HANGING else ""

    @property
    def hanging(self) -> int:
        """Number of abandoned threads that still hang."""
        self._abandoned = [each for each in self._abandoned if each.is_alive()]
        return len(self._abandoned)

    def supervise(self, now: float) -> bool:
        """Abandon a reader that is late or has failed, start a new one when it is due, and return whether the camera is
        lost. now: monotonic time [s]."""
        with self._lock:
            if self.ended:
                return False
            reader = self._reader
            if reader is not None:
                since = max(self._fresh, self._opened)
                limit = self.settings.lost_ms if self._fresh > self._opened else self.settings.open_ms
                late = now - since > 1e-3 * limit
                if late:
                    self.trouble = f"no new frame for {now - since:.1f} s"
                if late or reader.failed:
                    self._abandon(reader, now)
            lost = self._reader is None or self._fresh <= self._opened
            due = self._reader is None and now >= self._retry
        if due and self.hanging < MOST_HANGING:
            self.counts.reconnects += 1
            self.start()
        return lost

    def _abandon(self, reader: _Reader, now: float) -> None:
        reader.abandoned = True
        self._abandoned.append(reader)
        self._reader = None
        self._newest = None
        self._retry = now + self._pause
        self._pause = min(2.0 * self._pause, 1e-3 * self.settings.longest_retry_ms)

    def stop(self, seconds: float) -> None:
        """Stop, and wait up to `seconds` [s] for the threads to close the camera."""
        with self._lock:
            if self._reader is not None:
                self._abandon(self._reader, time.monotonic())
            self.ended = True
        deadline = time.monotonic() + seconds
        for each in self._abandoned:
            each.join(max(deadline - time.monotonic(), 0.0))

    def _deliver(self, reader: _Reader, shot: Shot) -> None:
        arrived = time.monotonic()
        with self._lock:
            if reader is not self._reader:
                return
            if shot.captured > arrived + EARLY:
                self.trouble = f"frame time is {shot.captured - arrived:.3f} s in the future"
                self.counts.ahead += 1
                return
            if self.settings.frozen and self._image is not None and same_image(shot.image, self._image):
                self.trouble = "the camera repeats the same image"
                self.counts.frozen += 1
                return
            self._image = shot.image
            self.counts.grabbed += 1
            self.counts.skipped += self._newest is not None
            self._newest = replace(shot, arrived=arrived)
            self._fresh = arrived
            self._pause = 1e-3 * self.settings.retry_ms
        self._wake()

    def _report(self, reader: _Reader, trouble: str, broken: int = 0) -> None:
        with self._lock:
            if reader is self._reader:
                self.trouble = trouble
                self.counts.broken += broken

    def _end(self, reader: _Reader) -> None:
        with self._lock:
            if reader is self._reader:
                self.ended = True
        self._wake()


def _share_arenas() -> None:
    """Limit the arenas of this process. Otherwise each thread that opens a lost camera may get its own, which then
    keeps some MiB. Does nothing if the C library has no arenas."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, _ARENAS)


class _Reader(threading.Thread):
    """Reads a camera until the camera fails or ends, or the grabber abandons the thread."""

    def __init__(self, grabber: Grabber, opener: Opener) -> None:
        super().__init__(name="camera", daemon=True)
        self.abandoned = False
        self.failed = False
        self._grabber = grabber
        self._opener = opener

    def run(self) -> None:
        """Open, read and close the camera."""
        try:
            camera = self._opener()
            try:
                self._read(camera)
            finally:
                camera.close()
        except (VisualMeshError, cv2.error, OSError, ValueError, MemoryError) as error:
            self._grabber._report(self, one_line(error))
        finally:
            self.failed = True
            self._grabber._wake()

    def _read(self, camera: Camera) -> None:
        while not self.abandoned:
            try:
                shot = camera.read()
            except BrokenFrameError as error:
                self._grabber._report(self, str(error), broken=1)
                continue
            if shot is None:
                self._grabber._end(self)
                return
            self._grabber._deliver(self, shot)


def same_image(one: Image, other: Image) -> bool:
    """Whether two images are identical. It compares every sixteenth row only, which noise always changes."""
    return one.shape == other.shape and bool(np.array_equal(one[::16], other[::16]))
