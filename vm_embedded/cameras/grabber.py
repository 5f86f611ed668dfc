"""Takes frames from a camera in a thread of its own, and keeps the newest one only.

A camera that gives no new frame in time is lost: its thread is left to itself, however long its read hangs, and another
one opens the camera again, after pauses that double. What a thread gives that was left to itself counts for nothing.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2

from ..arrays import Image
from ..errors import VisualMeshError, one_line
from .camera import BrokenFrameError, Camera, CameraSettings, Shot, same_image
from .open_camera import Opener

MOST_LEFT = 8
"""Threads that may hang at a time; with more of them only a new process helps."""

_EARLY = 0.005
"""Seconds that a frame's time may lie ahead: clocks are read one after the other."""


@dataclass
class Counts:
    """What became of frames: grabbed are new ones; skipped gave way to newer ones; broken, frozen and ahead (from the
    future) were not used. reconnects: times that a camera was opened again."""

    grabbed: int = 0
    skipped: int = 0
    broken: int = 0
    frozen: int = 0
    ahead: int = 0
    reconnects: int = 0

    @property
    def spoilt(self) -> int:
        """Frames that were not used because something was wrong with them."""
        return self.broken + self.frozen + self.ahead


class Grabber:
    """The newest shot of a camera.

    wake: called in another thread whenever there is a shot or the camera has failed.
    """

    def __init__(self, opener: Opener, settings: CameraSettings, wake: Callable[[], None]) -> None:
        self.settings = settings
        self.counts = Counts()
        self.trouble = ""
        """What is wrong with the camera, or was last."""
        self.ended = False
        """Whether the camera has come to its end, as files do."""
        self._opener = opener
        self._wake = wake
        self._lock = threading.Lock()
        self._newest: Shot | None = None
        self._image: Image | None = None  # of the last new frame, also across readers
        self._fresh = -math.inf  # when the last new frame came
        self._opened = 0.0  # when the last try to open the camera began
        self._retry = 0.0  # when to try again, if there is no reader
        self._pause = 1e-3 * settings.retry_ms
        self._reader: _Reader | None = None
        self._left: list[_Reader] = []

    def start(self) -> None:
        """Open the camera."""
        self._opened = time.monotonic()
        self._reader = _Reader(self, self._opener)
        self._reader.start()

    def take(self) -> Shot | None:
        """The newest shot, if it was not taken yet."""
        with self._lock:
            shot, self._newest = self._newest, None
        return shot

    @property
    def waiting(self) -> bool:
        """Whether there is a shot to take."""
        return self._newest is not None

    @property
    def hanging(self) -> int:
        """Threads that were left to themselves and still hang."""
        self._left = [each for each in self._left if each.is_alive()]
        return len(self._left)

    def supervise(self, now: float) -> bool:
        """Leave a reader that is late, begin a new one when it is time to; whether the camera is lost."""
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
                    self._leave(reader, now)
            lost = self._reader is None or self._fresh <= self._opened
            due = self._reader is None and now >= self._retry
        if due and self.hanging < MOST_LEFT:
            self.counts.reconnects += 1
            self.start()
        return lost

    def _leave(self, reader: _Reader, now: float) -> None:
        reader.left = True
        self._left.append(reader)
        self._reader = None
        self._newest = None
        self._retry = now + self._pause
        self._pause = min(2.0 * self._pause, 1e-3 * self.settings.longest_retry_ms)

    def stop(self, seconds: float) -> None:
        """End, and wait so long for threads to close the camera."""
        with self._lock:
            if self._reader is not None:
                self._leave(self._reader, time.monotonic())
            self.ended = True
        deadline = time.monotonic() + seconds
        for each in self._left:
            each.join(max(deadline - time.monotonic(), 0.0))

    def _give(self, reader: _Reader, shot: Shot) -> None:
        arrived = time.monotonic()
        with self._lock:
            if reader is not self._reader:
                return
            if shot.captured > arrived + _EARLY:
                self.trouble = f"a frame came from {shot.captured - arrived:.3f} s ahead"
                self.counts.ahead += 1
                return
            if self.settings.frozen and self._image is not None and same_image(shot.image, self._image):
                self.trouble = "the same picture came again"
                self.counts.frozen += 1
                return
            self._image = shot.image
            self.counts.grabbed += 1
            self.counts.skipped += self._newest is not None
            self._newest = replace(shot, arrived=arrived)
            self._fresh = arrived
            self._pause = 1e-3 * self.settings.retry_ms
        self._wake()

    def _complain(self, reader: _Reader, trouble: str, broken: int = 0) -> None:
        with self._lock:
            if reader is self._reader:
                self.trouble = trouble
                self.counts.broken += broken

    def _end(self, reader: _Reader) -> None:
        with self._lock:
            if reader is self._reader:
                self.ended = True
        self._wake()


class _Reader(threading.Thread):
    """Reads a camera until it fails, ends or is left."""

    def __init__(self, grabber: Grabber, opener: Opener) -> None:
        super().__init__(name="camera", daemon=True)
        self.left = False
        self.failed = False
        self._grabber = grabber
        self._opener = opener

    def run(self) -> None:
        """Open, read, close."""
        try:
            camera = self._opener()
            try:
                self._read(camera)
            finally:
                camera.close()
        except (VisualMeshError, cv2.error, OSError, ValueError, MemoryError) as error:
            self._grabber._complain(self, one_line(error))
        finally:
            self.failed = True
            self._grabber._wake()

    def _read(self, camera: Camera) -> None:
        while not self.left:
            try:
                shot = camera.read()
            except BrokenFrameError as error:
                self._grabber._complain(self, str(error), broken=1)
                continue
            if shot is None:
                self._grabber._end(self)
                return
            self._grabber._give(self, shot)
