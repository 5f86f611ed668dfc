"""The colors of the picture at the points of the mesh."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Image, Singles
from ..errors import InputError, unknown
from .footprint import Levels

# For each format: its channels, and which of them are red, green and blue.
_CHANNELS = {"bgr": (3, (2, 1, 0)), "rgb": (3, (0, 1, 2)), "bgra": (4, (2, 1, 0)), "rgba": (4, (0, 1, 2))}

# Named after the upper left 2 x 2 pixels; OpenCV names the same patterns by the second row and column.
_BAYER = {
    "bayer_rggb": cv2.COLOR_BayerBG2RGB,
    "bayer_bggr": cv2.COLOR_BayerRG2RGB,
    "bayer_grbg": cv2.COLOR_BayerGB2RGB,
    "bayer_gbrg": cv2.COLOR_BayerGR2RGB,
}

FORMATS = (*_CHANNELS, "grey", *_BAYER)
"""Pixel formats of a frame."""

SAMPLINGS = ("exact", "fast")
"""exact: bilinear in floating point. fast: OpenCV's 8-bit way, rounded to whole grey levels and 1/32 px."""

_FOLD = 256  # remap takes tables of at most 32766 a side, so the list of points is folded


def checked_image(image: Image, format: str) -> Image:
    """The image, if it is one of that format: 8 bit, (height, width, channels), at least 2 x 2 px.

    A grey image may come without its last axis. Raises InputError.
    """
    if format not in FORMATS:
        raise InputError(unknown("pixel format", format, FORMATS))
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        kind = image.dtype if isinstance(image, np.ndarray) else type(image).__name__
        raise InputError(f"image must be an array of uint8, not {kind}")
    channels = _CHANNELS[format][0] if format in _CHANNELS else 1
    flat = image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 1)
    if not (image.ndim == 3 and image.shape[2] == channels) and not (channels == 1 and flat):
        raise InputError(f"a {format} image must be of shape (height, width, {channels}), not {image.shape}")
    if min(image.shape[:2]) < 2:
        raise InputError(f"image must be at least 2 x 2 px, not {image.shape[1]} x {image.shape[0]}")
    return image.reshape(*image.shape[:2]) if channels == 1 else image


def sample(
    image: Image, pixels: Floats, format: str, sampling: str, out: Singles, levels: Levels | None = None
) -> None:
    """Write the RGB colors, scaled to 0..1, at pixels (n, 2) into `out` (n, 3).

    `image` is one that `checked_image` returned. Pixels without all four pixels around them in it give any color.
    levels: which points take their color from pictures that were halved, if the network is for footprints.
    """
    if format in _BAYER:
        image, format = cv2.cvtColor(image, _BAYER[format]), "rgb"  # type: ignore[assignment]
    take = _exact if sampling == "exact" else _fast
    channels = _CHANNELS[format][1] if format in _CHANNELS else (0, 0, 0)
    with np.errstate(invalid="ignore", over="ignore"):  # what the lens doesn't see has any pixel, NaN too
        if levels is None:
            planes = take(image, pixels)
            for column, channel in enumerate(channels):
                np.multiply(planes[channel], np.float32(1.0 / 255.0), out=out[:, column])
            return
        for level, points in enumerate(levels):
            if level:
                image = _halved(image)
            if len(points):
                planes = take(image, _in_halved(pixels[points], level, image))
                for column, channel in enumerate(channels):
                    out[points, column] = planes[channel] * np.float32(1.0 / 255.0)


def _halved(image: Image) -> Image:
    """A picture of half the width and height; the last row and column of an odd number are left out."""
    height, width = (max(side // 2, 1) for side in image.shape[:2])
    even = image[: 2 * height, : 2 * width]
    return np.asarray(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _in_halved(pixels: Floats, level: int, image: Image) -> Floats:
    """Pixels (n, 2) of the whole picture in one that was halved `level` times; at its border what is nearest."""
    if not level:
        return pixels
    return np.clip((pixels + 0.5) / 2.0**level - 0.5, 0.0, (image.shape[1] - 1.0, image.shape[0] - 1.0))


def _exact(image: Image, pixels: Floats) -> Singles:
    """Values (channels, n), 0 to 255, bilinear in floating point."""
    x, y = pixels.T
    left, upper = np.floor(x), np.floor(y)
    right, down = (x - left).astype(np.float32), (y - upper).astype(np.float32)
    corners = np.empty((2, 2, len(pixels), 2), dtype=np.float32)
    corners[..., 0] = left, left + 1.0
    corners[0, ..., 1], corners[1, ..., 1] = upper, upper + 1.0
    values = _remapped(image, corners.reshape(-1, 2), cv2.INTER_NEAREST)
    rows = values.reshape(len(values), 2, 2, len(pixels))
    above, below = (row[:, 0] + right * (row[:, 1] - row[:, 0]) for row in (rows[:, 0], rows[:, 1]))
    return np.asarray(above + down * (below - above))


def _fast(image: Image, pixels: Floats) -> Singles:
    """Values (channels, n), 0 to 255, by OpenCV's table of 1/32 px."""
    return _remapped(image, pixels, cv2.INTER_LINEAR)


def _remapped(image: Image, pixels: npt.NDArray[np.floating], interpolation: int) -> Singles:
    """Values (channels, n), 0 to 255, at pixels (n, 2)."""
    rows = -(-len(pixels) // _FOLD)
    if rows == 0:
        return np.empty((image.shape[2] if image.ndim == 3 else 1, 0), dtype=np.float32)
    table = np.zeros((rows * _FOLD, 2), dtype=np.float32)
    table[: len(pixels)] = pixels
    values = cv2.remap(image, table.reshape(rows, _FOLD, 2), None, interpolation)  # type: ignore[call-overload]
    planes = cv2.dnn.blobFromImage(values)  # one plane for each channel, as float32
    return np.asarray(planes.reshape(-1, rows * _FOLD)[:, : len(pixels)])
