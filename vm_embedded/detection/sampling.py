"""The colors of the picture at the points of the mesh, bilinear in floating point.

They are the network's input (paper: section "Graph Structure of the Mesh").
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Mask, Singles
from .footprint import BLOCK, Levels
from .pyramid import Pyramid


def sample(pyramid: Pyramid, pixels: Floats, levels: Levels) -> Singles:
    """Red, green and blue (3, n), from 0 to 1, at pixels (n, 2) of the frame.

    levels: which picture of the pyramid colors each point. The color is arbitrary where one of the four pixels around a
    point is outside of the image.
    """
    colors = np.empty((3, len(pixels)), dtype=np.float32)
    if not len(pixels):
        return colors
    with np.errstate(invalid="ignore", over="ignore"):  # pixels outside of the lens's view may be NaN
        places = _in_pictures(pyramid, pixels, levels)
        whole = np.floor(places)
        right, down = (places - whole).astype(np.float32)
        corners = _corners(pyramid, levels, whole.astype(np.int16).astype(np.int32))
    left = corners[..., 0, :]
    rows = corners[..., 1, :] - left
    rows *= right[:, None]
    rows += left
    upper = rows[:, :, 0]
    values = rows[:, :, 1] - upper
    values *= down
    values += upper
    values *= np.float32(1.0 / 255.0)
    for color, channel in zip(colors, pyramid.channels, strict=True):
        np.take(values[channel], levels.places, out=color, mode="clip")
    return colors


def _in_pictures(pyramid: Pyramid, pixels: Floats, levels: Levels) -> Floats:
    """Pixels (2, blocks, BLOCK), x and y, of the points, each in its picture; clipped to the border of halved ones."""
    places = np.stack([np.take(axis, levels.order) for axis in pixels.T]).reshape(2, -1, BLOCK)
    if len(levels.ends) > 1:
        size = np.array(pyramid.level(0).shape[1::-1])
        halvings = np.concatenate([np.full(share.stop - share.start, level) for level, share in levels.shares()])
        factor, whole = 0.5**halvings, halvings == 0
        places *= factor[:, None]
        places += 0.5 * (factor - 1.0)[:, None]  # pixels count from the middle of the first one
        last = np.maximum(size[:, None] >> halvings, 1) - 1.0
        np.maximum(places, np.where(whole, -np.inf, 0.0)[:, None], out=places)
        np.minimum(places, np.where(whole, np.inf, last)[:, :, None], out=places)
    return places


def _corners(pyramid: Pyramid, levels: Levels, whole: npt.NDArray[np.int32]) -> Singles:
    """Values (channels, blocks, 2, 2, BLOCK), 0 to 255, of the upper and lower, left and right pixel around each place.

    whole (2, blocks, BLOCK): x and y of the upper left one, from -2^15 to 2^15 - 1.
    """
    count = whole.shape[1]
    # OpenCV takes x and y as two int16. Here they are the lower and the upper half of an int32, so that one addition
    # moves a place.
    places = np.empty((count, 2, 2, BLOCK), dtype=np.int32)
    x, y = whole
    np.bitwise_or(y << 16, x & 0xFFFF, out=places[:, 0, 0])
    np.add(places[:, 0, 0], 1, out=places[:, 0, 1])
    np.add(places[:, 0], 1 << 16, out=places[:, 1])
    table = places.view(np.int16).reshape(count, 4 * BLOCK, 2)
    frame = pyramid.level(0)
    values = np.empty((count, 4 * BLOCK, *frame.shape[2:]), dtype=np.uint8)
    for level, share in levels.shares():
        cv2.remap(pyramid.level(level), table[share], None, cv2.INTER_NEAREST, dst=values[share])  # type: ignore[call-overload]
    planes = np.asarray(cv2.dnn.blobFromImage(values), dtype=np.float32)  # one for each channel
    return planes.reshape(-1, count, 2, 2, BLOCK)


_LEAST_DEVIATION = 0.02
"""Deviation of a picture without contrast: its noise must not become a pattern."""


def normalized(colors: Singles, kind: str, counted: Mask | None = None) -> Singles:
    """The colors (3, n) that a network takes, from red, green and blue (3, n), each from 0 to 1.

    kind: one of manifest.POINT_COLORS. "absolute" leaves them. "relative" subtracts each channel's mean over the points
    that are `counted` (n,), by default all, and divides by its standard deviation.

    Sums are in double precision, so the digits don't depend on the order of the points.
    """
    if kind == "absolute":
        return colors
    seen = colors if counted is None else colors.compress(counted, axis=1)
    if not seen.size:
        return colors
    deviations = seen.astype(np.float64)
    mean = deviations.mean(axis=1, keepdims=True)
    deviations -= mean
    deviation = np.sqrt(np.square(deviations, out=deviations).mean(axis=1, keepdims=True))
    factor = (1.0 / np.maximum(deviation, _LEAST_DEVIATION)).astype(np.float32)
    return np.asarray((colors - mean.astype(np.float32)) * factor)
