"""Decode images from the bytes of a file or a camera."""

from __future__ import annotations

import re

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays import Image
from ..errors import InputError
from .camera import BrokenFrameError
from .image_header import MAX_MEGAPIXELS, check_size
from .library_messages import library_messages

_TAIL = 1024
"""Bytes at the end of a file in which to look for its end marker; cameras and programs append other data to it."""

_DAMAGED = re.compile(
    r"Premature end of JPEG|Corrupt JPEG data: (?!\d+ extraneous bytes before marker 0xd9)|libpng error: "
)
"""What libjpeg and libpng say about an image with missing or wrong parts. Some cameras put bytes between a JPEG and its
end marker, which do no harm."""


def decode(content: bytes, raw: bool = False, max_megapixels: float = MAX_MEGAPIXELS) -> Image:
    """Decode an image file to BGR, or with `raw` to its own channels; 16 bits become 8.

    Raises InputError for content that is not an image, is larger than `max_megapixels` [Mpx], or has missing or damaged
    parts: OpenCV would fill them with gray, and report success.
    """
    flags = cv2.IMREAD_UNCHANGED if raw else cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    image = decode_as(content, flags, max_megapixels)
    if image.dtype == np.uint16:
        return (image.view(np.uint16) >> 8).astype(np.uint8)  # as OpenCV does for BGR
    if image.dtype != np.uint8:
        raise InputError(f"has {image.dtype} values; only images of 8 and 16 bits are supported")
    return np.asarray(image, dtype=np.uint8)


def decode_as(content: bytes, flags: int, max_megapixels: float = MAX_MEGAPIXELS) -> npt.NDArray[np.generic]:
    """Like `decode`, with the flags of cv2.imdecode, which may keep other types than uint8. Raises InputError."""
    check_size(content, max_megapixels)
    if content.startswith(b"\xff\xd8") and b"\xff\xd9" not in content.rstrip(b"\x00")[-_TAIL:]:  # some cameras pad it
        raise InputError("is cut short")
    with library_messages() as messages:
        image = _decoded(content, flags)
    damage = next(filter(_DAMAGED.match, messages), None)
    if damage:
        raise InputError(f"is cut short or damaged ({damage})")
    if image is None:
        raise InputError("can't be decoded as an image")
    return image


def _decoded(content: bytes, flags: int) -> npt.NDArray[np.generic] | None:
    """What OpenCV decodes, None if it can't."""
    try:
        return cv2.imdecode(np.frombuffer(content, dtype=np.uint8), flags)
    except cv2.error:
        return None


def decode_frame(content: bytes, raw: bool = False, max_megapixels: float = MAX_MEGAPIXELS) -> Image:
    """Decode an image that a camera sent. Raises BrokenFrameError where `decode` raises InputError."""
    try:
        return decode(content, raw, max_megapixels)
    except InputError as error:
        raise BrokenFrameError(f"frame of {len(content)} bytes {error}") from error
