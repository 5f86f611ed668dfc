"""A video file of pictures with the detections drawn in."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType

import cv2

from ..arrays import Image
from ..borders.opencv_text import open_capture, open_writer
from ..cameras.library_messages import library_messages
from ..errors import InputError, unknown
from ..files import check_writable, put_in_place, real_path, unused_name

_CODECS = {".mp4": "mp4v", ".avi": "MJPG", ".webm": "VP80"}
"""FFmpeg's code of the codec for each suffix; OpenCV's wheels have these."""

_FASTEST = 1000.0
"""Largest rate of a video [1/s]: OpenCV drops frames of a faster .avi."""


class VideoFile:
    """Writes BGR pictures of one size to a .mp4, .avi or .webm at a rate [1/s], at most 1000; a context manager.

    The file is written beside its place, under a name that nothing has. It gets its own at the end, also after an
    error, so an old file is replaced only by a complete one. Without any picture, no file is written. inputs: files
    that it must not replace. Raises InputError for one of these, for another suffix, and for a folder that does not
    exist.
    """

    def __init__(self, path: Path, rate: float, inputs: Sequence[Path] = ()) -> None:
        suffix = path.suffix.lower()
        if suffix not in _CODECS:
            raise InputError(f"can't write the video {path}: {unknown('suffix', suffix, _CODECS)}")
        check_writable(path, inputs)
        self._path, self._target = path, real_path(path)
        self._part = unused_name(self._target, f".part{suffix}")
        self._rate, self._codec = min(rate, _FASTEST), cv2.VideoWriter.fourcc(*_CODECS[suffix])
        self._writer: cv2.VideoWriter | None = None
        self._size, self._written = (0, 0), 0

    def write(self, picture: Image) -> None:
        """Add a picture. Raises InputError for another size than that of the first, or if it can't be written."""
        size = picture.shape[1], picture.shape[0]
        if self._writer is None:
            self._size = size
            try:
                self._part.touch(exist_ok=False)
                with library_messages():  # one for each .webm: FFmpeg does not list the codec's code, but has it
                    self._writer = open_writer(self._part, self._codec, self._rate, size)
            except OSError as error:
                raise InputError(f"can't write the video {self._path}: {error.strerror or error}") from error
        if not self._writer.isOpened():
            raise InputError(f"can't write the video {self._path}: OpenCV can't encode it or create the file")
        if size != self._size:
            raise InputError(
                f"it has {size[0]} x {size[1]} px, but all pictures of the video {self._path} must be as large as the "
                f"first, {self._size[0]} x {self._size[1]} px"
            )
        self._writer.write(picture)
        self._written += 1

    def __enter__(self) -> VideoFile:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        if self._writer is None:
            return
        self._writer.release()
        found = _count_frames(self._part, self._written) if self._written else 0
        if self._written and found == self._written:
            try:
                put_in_place(self._part, self._target)
            except OSError as error:
                reason = error.strerror or error
                raise InputError(f"can't write {self._path}: {reason}; it is in {self._part}") from error
            return
        with suppress(OSError):  # a disk that failed
            self._part.unlink()
        if self._written:
            raise InputError(
                f"can't write the video {self._path}: only {found} of {self._written} frames were written; "
                "is the disk full?"
            )


def _count_frames(path: Path, expected: int) -> int:
    """Number of frames in a video file; 0 if it can't be read. OpenCV reports no error of writing.

    The number that the file states is written last, so if it is the expected one, the frames need not be read.
    """
    capture = open_capture(path)
    count = round(capture.get(cv2.CAP_PROP_FRAME_COUNT))
    if count != expected:
        count = 0
        while capture.grab():
            count += 1
    capture.release()
    return count
