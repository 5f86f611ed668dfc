"""Pixel formats of frames: which channels they have, and checking that an image has the one it should have."""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import AnyImage, Image
from ..errors import InputError, unknown

# For each format: its number of channels, and the positions of red, green and blue.
_CHANNELS = {"bgr": (3, (2, 1, 0)), "rgb": (3, (0, 1, 2)), "bgra": (4, (2, 1, 0)), "rgba": (4, (0, 1, 2))}

# The names give the upper left 2 x 2 pixels; OpenCV names the same patterns by the second row and column.
_BAYER = {
    "bayer_rggb": cv2.COLOR_BayerBG2RGB,
    "bayer_bggr": cv2.COLOR_BayerRG2RGB,
    "bayer_grbg": cv2.COLOR_BayerGB2RGB,
    "bayer_gbrg": cv2.COLOR_BayerGR2RGB,
}

FORMATS = (*_CHANNELS, "gray", *_BAYER)
"""Pixel formats of a frame."""

_LARGEST_SIDE = 32766
"""Largest width and height that OpenCV's remap takes [px]."""


def checked_image(image: AnyImage | None, format: str) -> Image:
    """The image, if it has that format: uint8, (height, width, channels), with sides of 2 to 32766 px.

    A gray or Bayer image may come without its last axis, and loses it. Raises InputError.
    """
    if format not in FORMATS:
        raise InputError(unknown("pixel format", format, FORMATS))
    if image is None:
        raise InputError(
            "image must be an array of uint8, not NoneType, which cv2.imread returns for a file that it can't read"
        )
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        kind = image.dtype if isinstance(image, np.ndarray) else type(image).__name__
        raise InputError(f"image must be an array of uint8, not {kind}")
    channels = _CHANNELS[format][0] if format in _CHANNELS else 1
    flat = image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 1)
    if not (image.ndim == 3 and image.shape[2] == channels) and not (channels == 1 and flat):
        raise InputError(f"a {format} image must have the shape (height, width, {channels}), not {image.shape}")
    if min(image.shape[:2]) < 2 or max(image.shape[:2]) > _LARGEST_SIDE:
        raise InputError(
            f"image must have from 2 x 2 to {_LARGEST_SIDE} x {_LARGEST_SIDE} px, not {image.shape[1]} x "
            f"{image.shape[0]}"
        )
    return image.reshape(*image.shape[:2]) if channels == 1 else image


def rgb_channels(image: Image, format: str) -> tuple[Image, tuple[int, int, int]]:
    """A checked image, with a Bayer pattern turned into colors, and the positions of its red, green and blue."""
    if format in _BAYER:
        return np.asarray(cv2.cvtColor(image, _BAYER[format]), dtype=np.uint8), (0, 1, 2)
    return image, _CHANNELS[format][1] if format in _CHANNELS else (0, 0, 0)
