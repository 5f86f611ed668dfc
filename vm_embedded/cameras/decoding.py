"""Pictures from the bytes of a file or of a camera."""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import Image
from ..errors import InputError

_TAIL = 1024
"""Bytes at the end among which a file says that it ends; cameras and programs append what they like."""


def decode(content: bytes, raw: bool = False) -> Image:
    """An image file as BGR, or with `raw` in the channels that it has.

    Raises InputError for one that can't be decoded, and for a JPEG or PNG that is cut short: OpenCV would decode what
    there is, fill up with grey, and call it success.
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
        raise InputError("is no image that can be decoded")
    return np.asarray(image, dtype=np.uint8)
