"""A video file of pictures with the detections drawn in."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

import cv2

from ..arrays import Image
from ..errors import InputError, unknown
from ..files import check_writable

_CODECS = {".mp4": "mp4v", ".avi": "MJPG", ".webm": "VP80"}
"""FFmpeg's code of the codec for each suffix; OpenCV's wheels have these."""


class VideoFile:
    """Writes BGR pictures of one size to a .mp4, .avi or .webm at a rate [1/s]; a context manager.

    The file is written beside its place and renamed at the end, also after an error, so an old file is replaced only by
    a complete one. Without any picture, no file is written. Raises InputError for another suffix or folder.
    """

    def __init__(self, path: Path, rate: float) -> None:
        suffix = path.suffix.lower()
        if suffix not in _CODECS:
            raise InputError(f"can't write the video {path}: {unknown('suffix', suffix, _CODECS)}")
        check_writable(path)
        self._path, self._part = path, path.with_name(f"{path.stem}.part{suffix}")
        self._rate, self._codec = rate, cv2.VideoWriter.fourcc(*_CODECS[suffix])
        self._writer: cv2.VideoWriter | None = None
        self._size = (0, 0)

    def write(self, picture: Image) -> None:
        """Add a picture. Raises InputError for another size than that of the first, or if it can't be written."""
        size = picture.shape[1], picture.shape[0]
        if self._writer is None:
            self._size = size
            self._writer = cv2.VideoWriter(str(self._part), self._codec, self._rate, size)
        if not self._writer.isOpened():
            raise InputError(f"can't write the video {self._path}: OpenCV can't encode it or create the file")
        if size != self._size:
            raise InputError(
                f"it has {size[0]} x {size[1]} px, but all pictures of the video {self._path} must be as large as the "
                f"first, {self._size[0]} x {self._size[1]} px"
            )
        self._writer.write(picture)

    def __enter__(self) -> VideoFile:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        if self._writer is None or not self._writer.isOpened():
            return
        self._writer.release()
        try:
            self._part.replace(self._path)
        except OSError as error:
            raise InputError(f"can't write {self._path}: {error.strerror or error}; it is in {self._part}") from error
