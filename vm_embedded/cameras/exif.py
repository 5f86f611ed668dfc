"""The EXIF entry that says how to turn an image file.

The rule for all programs: an image is turned as this entry says, as films are. Lenses, poses, boxes, masks and results
refer to the turned image.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import suppress

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from .image_header import PNG_START, is_tiff, jpeg_segments, png_chunks, tiff_values

UPRIGHT = 1
"""The EXIF orientation of an image that is stored upright."""

_ORIENTATION = 0x0112
_START = b"Exif\0\0"


def orientation_of(content: bytes) -> int:
    """The EXIF orientation of an image file, from 1 to 8. An entry that is missing or damaged counts as 1, upright."""
    with suppress(struct.error, IndexError, ValueError, InputError):  # it ends within its header
        entry = next(filter(is_tiff, _entries(content)), b"")
        found = tiff_values(entry, [_ORIENTATION])[_ORIENTATION]
        if found in range(1, 9):
            return found
    return UPRIGHT


def turned(image: npt.NDArray[np.generic], orientation: int) -> npt.NDArray[np.generic]:
    """An image as stored (h, w[, channels]), after the turn of its EXIF orientation."""
    if orientation >= 5:
        image = np.swapaxes(image, 0, 1)
    if orientation in (2, 3, 6, 7):
        image = image[:, ::-1]
    if orientation in (3, 4, 7, 8):
        image = image[::-1]
    return np.ascontiguousarray(image)


def _entries(content: bytes) -> Iterator[bytes]:
    """What may be the EXIF entries of an image file. They have the form of a TIFF file."""
    if content.startswith(b"\xff\xd8"):
        for marker, at in jpeg_segments(content):
            if marker == 0xE1 and content.startswith(_START, at + 2):
                yield content[at + 2 + len(_START) : at + int.from_bytes(content[at : at + 2], "big")]
    elif content.startswith(PNG_START):
        for kind, at, length in png_chunks(content):
            if kind == b"eXIf":
                yield content[at : at + length]
    elif content.startswith(b"RIFF"):
        at = 12
        while at < len(content):
            kind, length = struct.unpack_from("<4sI", content, at)
            if kind == b"EXIF":
                yield content[at + 8 : at + 8 + length].removeprefix(_START)
            at += 8 + length + length % 2
    else:
        yield content
