"""What other libraries print: lines of libjpeg, libpng and OpenCV's FFmpeg are collected; OpenCV's log is silenced.

Damage is reported only there: libjpeg fills the rest of the picture with gray, and OpenCV reports success.
"""

from __future__ import annotations

import os
import re
import select
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import cv2

from ..files import takes_more

_STDERR = 2

_WARNING = re.compile(
    r"Corrupt JPEG data|Premature end of JPEG|Invalid SOS parameters|Inconsistent progression|Unknown Adobe|"
    r"Warning: unknown JFIF|libpng (?:error|warning): |OpenCV: FFMPEG: "
)
"""First words of the warnings. libjpeg prints the first warning about each image."""

_LOCK = threading.Lock()
"""Only one thread at a time may redirect standard error."""


@contextmanager
def library_messages() -> Iterator[list[str]]:
    """Collect the lines that these libraries print in this block; the list is complete after the block.

    Lines of other threads go to standard error when the block ends; they are lost if nobody reads it.
    """
    found: list[str] = []
    with _LOCK:
        file = os.memfd_create("messages")
        try:
            before = _duplicate()
            os.dup2(file, _STDERR)
            try:
                yield found
            finally:
                if before is None:
                    os.close(_STDERR)
                else:
                    os.dup2(before, _STDERR)
                    os.close(before)
            written = os.pread(file, 2**16, 0)
        finally:
            os.close(file)
    if written:
        lines = written.decode("utf-8", "replace").splitlines(keepends=True)
        found += [line.strip() for line in lines if _WARNING.match(line)]
        others = "".join(line for line in lines if line.strip() and not _WARNING.match(line))
        if before is not None:
            _pass_on(others.encode())


def _pass_on(content: bytes) -> None:
    """Write to standard error as much as it takes without waiting."""
    with suppress(OSError):
        while content and takes_more(_STDERR):
            content = content[os.write(_STDERR, content[: select.PIPE_BUF]) :]


def _duplicate() -> int | None:
    """A copy of the descriptor of standard error, None if it is closed."""
    try:
        return os.dup(_STDERR)
    except OSError:
        return None


def silence_opencv() -> None:
    """Make OpenCV and its FFmpeg print nothing: this program reports problems with files and cameras itself."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    if hasattr(cv2, "setLogLevel"):  # until OpenCV 4
        cv2.setLogLevel(0)
    else:
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
