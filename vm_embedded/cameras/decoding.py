"""Decode images from the bytes of a file or a camera."""

from __future__ import annotations

from contextlib import suppress

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays import Image
from ..errors import InputError
from .camera import BrokenFrameError
from .exif import orientation_of, turned
from .image_header import MAX_MEGAPIXELS, check_size, is_tiff
from .jpeg_damage import check_damage, complete, is_progressive
from .library_messages import library_messages


def decode(content: bytes, raw: bool = False, max_megapixels: float = MAX_MEGAPIXELS) -> Image:
    """Decode an image file to BGR, or with `raw` to its own channels, turned as in exif.py; 16 bits become 8.

    Raises InputError for content that is not an image, is larger than `max_megapixels` [Mpx], or has missing or damaged
    parts: OpenCV would fill them with gray, and report success.
    """
    image = decode_as(content, cv2.IMREAD_UNCHANGED if raw else cv2.IMREAD_COLOR, max_megapixels)
    if image.dtype == np.uint16:
        return (image.view(np.uint16) >> 8).astype(np.uint8)  # as OpenCV does for BGR
    if image.dtype != np.uint8:
        raise InputError(f"has {image.dtype} values; only images of 8 and 16 bits are supported")
    return np.asarray(image, dtype=np.uint8)


def decode_as(content: bytes, flags: int, max_megapixels: float = MAX_MEGAPIXELS) -> npt.NDArray[np.generic]:
    """Like `decode`, with the flags of cv2.imdecode, which may keep other types than uint8. Raises InputError."""
    check_size(content, max_megapixels)
    image = _decode_whole(content, flags | cv2.IMREAD_IGNORE_ORIENTATION)
    # OpenCV turns a TIFF itself.
    return image if is_tiff(content) else turned(image, orientation_of(content))


def _decode_whole(content: bytes, flags: int) -> npt.NDArray[np.generic]:
    """What OpenCV decodes. Raises InputError for what is no image, or has missing or damaged parts."""
    if content.startswith(b"\xff\xd8"):
        return _decode_jpeg(content, flags)
    image, messages = _decode(content, flags)
    fault = next((each for each in messages if each.startswith("libpng error: ")), "")
    if fault:
        raise InputError(f"is cut short or damaged ({fault})")
    return _checked(image)


def _decode_jpeg(content: bytes, flags: int) -> npt.NDArray[np.generic]:
    content, had_end = complete(content)
    image, warnings = _decode(content, flags)
    if not had_end and (image is None or warnings or is_progressive(content)):
        raise InputError("is cut short")
    if warnings:
        check_damage(content, warnings[0])
    return _checked(image)


def _checked(image: npt.NDArray[np.generic] | None) -> npt.NDArray[np.generic]:
    if image is None:
        raise InputError("can't be decoded as an image")
    return image


def _decode(content: bytes, flags: int) -> tuple[npt.NDArray[np.generic] | None, list[str]]:
    """What OpenCV decodes, None if it can't; and the warnings of its libraries."""
    image = None
    with library_messages() as messages, suppress(cv2.error):
        image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), flags)
    return image, messages


def decode_frame(content: bytes, raw: bool = False, max_megapixels: float = MAX_MEGAPIXELS) -> Image:
    """Decode an image that a camera sent. Raises BrokenFrameError where `decode` raises InputError."""
    try:
        return decode(content, raw, max_megapixels)
    except InputError as error:
        raise BrokenFrameError(f"frame of {len(content)} bytes {error}") from error
