"""Read the frames of a video file, and go on behind damage in it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from ..arrays import Image
from ..borders.opencv_text import open_capture
from ..borders.text import utf8
from ..errors import InputError
from ..files import is_file, open_regular
from .camera import camera_number
from .frame_source import IMAGE_SUFFIXES, Frame, Source
from .video_size import check_frame, check_video

_MOST_LOST = 1000
"""Frames of a video in a row that can't be read before it counts as ended."""

_GUESSED = 0.02
"""Share of the frames by which a guess of their number may be wrong."""


def open_video(name: str, max_megapixels: float) -> Source:
    """The frames of a video file; or of a camera, by number or device path. Raises OSError for an unreadable file."""
    files = (Path(name),) if is_file(Path(name)) else ()
    number = camera_number(name)
    live = number is not None or Path(name).is_char_device()
    if not live:
        open_regular(Path(name)).close()  # OpenCV does not say why it can't read a file, and waits for a pipe's writer
    capture = open_capture(Path(name) if number is None else number)
    if not capture.isOpened():
        if live:
            raise InputError(f"can't open camera {name}")
        raise InputError(f"{name} is neither an image ({', '.join(IMAGE_SUFFIXES)}) nor a video that OpenCV can read")
    try:
        check_video(capture, max_megapixels)
    except InputError as error:
        raise InputError(f"{name} {error}") from error
    film = _Film(capture, Path(name), live, max_megapixels)
    return Source(film.frames(), film.count, film.rate, files, film.remarks)


class _Film:
    """The frames of a video, or of a camera if it is live.

    Damage in a video does not end it: each frame that is lost there can't be read, and what follows is read.
    count: number of frames, rate: frames per second [1/s]; None if unknown.
    """

    def __init__(self, capture: cv2.VideoCapture, path: Path, live: bool, max_megapixels: float) -> None:
        """Raises InputError if the first frame can't be read."""
        self._capture, self._path, self._live, self._max_megapixels = capture, path, live, max_megapixels
        count, rate = capture.get(cv2.CAP_PROP_FRAME_COUNT), capture.get(cv2.CAP_PROP_FPS)
        self.count = int(count) if not live and 0.0 < count < 1e9 else None
        self.rate = rate if 0.0 < rate < 1e4 else None
        self._first, self._lost_before = self._next()
        if self._first is None:
            raise InputError(f"{'camera' if live else 'video'} {path} contains no frames that can be read")
        self._read = self._lost = 0
        self._stamp = -math.inf  # of the last frame
        self._has_times = True

    def frames(self) -> Iterator[Frame]:
        """All frames, also those that can't be read."""
        image, lost = self._first, self._lost_before
        while image is not None:
            for _ in range(lost):
                yield self._frame(self._unreadable, None)
                self._lost += 1
            yield self._frame(partial(_of_video, image, self._path.name, self._max_megapixels), self._next_stamp())
            self._read += 1
            image, lost = self._next()
        self._capture.release()

    def _frame(self, read: Callable[[], Image], stamp: float | None) -> Frame:
        return Frame(self._read + self._lost, utf8(self._path.name), self._path.stem, read, None, stamp)

    def _next(self) -> tuple[Image | None, int]:
        """The next image, or None at the end; and how many frames before it could not be read."""
        for lost in range(1 if self._live else _MOST_LOST):
            good, image = self._capture.read()
            if good:
                return np.asarray(image, dtype=np.uint8), lost
        return None, 0

    def _unreadable(self) -> Image:
        raise InputError(f"{utf8(self._path.name)}: a frame is damaged and can't be read")

    def _next_stamp(self) -> float | None:
        """The time of the frame that was read last [s]: by the rate if the video has none; None without a rate."""
        stamp = float(self._capture.get(cv2.CAP_PROP_POS_MSEC)) / 1000.0
        if not math.isfinite(stamp) or stamp <= self._stamp:
            self._has_times = False
            if self.rate is None:
                return None
            stamp = max(self._stamp, 0.0) + 1.0 / self.rate
        self._stamp = stamp
        return stamp

    def remarks(self) -> list[str]:
        """What is missing."""
        name, found = utf8(self._path.name), []
        if self._lost or self._ends_early():
            of = "" if self.count is None else f" of {max(self.count, self._read + self._lost)}"
            why = "the video is damaged" if self._lost else "the video ends early"
            found.append(f"{name}: {self._read}{of} frames could be read; {why}")
        if not self._has_times and not self._live:
            by = "they have none" if self.rate is None else f"they are counted at {self.rate:g} frames per second"
            found.append(f"{name} does not tell the times of its frames: {by}")
        return found

    def _ends_early(self) -> bool:
        """Whether frames are missing at the end. Without an index, the number of frames is a guess from the length."""
        if self.count is None:
            return False
        missing = self.count - self._read - self._lost
        length = self._stamp + 1.0 / (self.rate or math.inf)
        too_short = self.rate is None or length < (self.count - 1) / self.rate
        return missing > max(1, _GUESSED * self.count) and too_short


def _of_video(image: Image, name: str, max_megapixels: float) -> Image:
    """A frame of a video. Raises InputError if it is too large."""
    try:
        check_frame(image, max_megapixels)
    except InputError as error:
        raise InputError(f"frame of {name} {error}") from error
    return image
