"""Decode images from the bytes of a file or a camera."""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import Image
from ..errors import InputError
from .camera import BrokenFrameError

_TAIL = 1024
"""Bytes at the end of a file in which to look for its end marker; cameras and programs append other data to it."""


def decode(content: bytes, raw: bool = False) -> Image:
    """Decode an image file to BGR, or with `raw` to its own channels.

    Raises InputError for content that is not an image, and for a JPEG or PNG without its end marker: OpenCV would
    decode the part that is there, fill the rest with gray, and report success.
    """
    tail = content.rstrip(b"\x00")[-_TAIL:]  # some cameras pad their buffers
    jpeg_cut = content.startswith(b"\xff\xd8") and b"\xff\xd9" not in tail
    png_cut = content.startswith(b"\x89PNG") and b"IEND" not in tail
    if jpeg_cut or png_cut:
        raise InputError("is cut short")
    image = None
    if content:
        flags = cv2.IMREAD_UNCHANGED if raw else cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
        try:
            image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), flags)
        except cv2.error:
            image = None
    if image is None:
        raise InputError("can't be decoded as an image")
    return np.asarray(image, dtype=np.uint8)


def decode_frame(content: bytes, raw: bool = False) -> Image:
    """Decode an image that a camera sent. Raises BrokenFrameError if it is cut short or not an image."""
    try:
        return decode(content, raw)
    except InputError as error:
        raise BrokenFrameError(f"frame of {len(content)} bytes {error}") from error
