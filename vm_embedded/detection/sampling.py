"""The colors of the picture at the points of the mesh, bilinear in floating point.

They are the network's input (paper: section "Graph Structure of the Mesh").
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Singles
from .footprint import BLOCK, Levels
from .pyramid import Pyramid


def sample(pyramid: Pyramid, pixels: Floats, levels: Levels, out: Singles) -> None:
    """Write the RGB colors, from 0 to 1, at pixels (n, 2) of the frame into `out` (n, 3).

    levels: which picture of the pyramid colors each point. The color is arbitrary where one of the four pixels around a
    point is outside of the image.
    """
    if not len(levels.order):
        return
    with np.errstate(invalid="ignore", over="ignore"):  # pixels outside of the lens's view may be NaN
        places = _in_pictures(pyramid, pixels, levels)
        whole = np.floor(places)
        right, down = (places - whole).astype(np.float32)
        corners = _corners(pyramid, levels, whole.astype(np.int16))
    left = corners[..., 0, :]
    rows = left + right[:, None] * (corners[..., 1, :] - left)
    upper = rows[:, :, 0]
    values = (upper + down * (rows[:, :, 1] - upper)) * np.float32(1.0 / 255.0)
    for column, channel in enumerate(pyramid.channels):
        out[levels.order, column] = values[channel].reshape(-1)


def _in_pictures(pyramid: Pyramid, pixels: Floats, levels: Levels) -> Floats:
    """Pixels (2, blocks, BLOCK), x and y, of the points, each in its picture; clipped to the border of halved ones."""
    places = np.stack([axis[levels.order] for axis in pixels.T]).reshape(2, -1, BLOCK)
    for level, share in levels.shares():
        if level:
            height, width = pyramid.level(level).shape[:2]
            for axis, last in zip(places[:, share], (width - 1.0, height - 1.0), strict=True):
                axis += 0.5
                axis *= 0.5**level
                axis -= 0.5
                np.clip(axis, 0.0, last, out=axis)
    return places


def _corners(pyramid: Pyramid, levels: Levels, whole: npt.NDArray[np.int16]) -> Singles:
    """Values (channels, blocks, 2, 2, BLOCK), 0 to 255, of the upper and lower, left and right pixel around each place.

    whole (2, blocks, BLOCK): x and y of the upper left one.
    """
    count = whole.shape[1]
    places = np.empty((count, 2, 2, BLOCK, 2), dtype=np.int16)
    for side in range(2):
        np.add(whole[0, :, None], side, out=places[:, :, side, :, 0])
        np.add(whole[1, :, None], side, out=places[:, side, :, :, 1])
    table = places.reshape(count, 4 * BLOCK, 2)
    frame = pyramid.level(0)
    values = np.empty((count, 4 * BLOCK, *frame.shape[2:]), dtype=np.uint8)
    for level, share in levels.shares():
        cv2.remap(pyramid.level(level), table[share], None, cv2.INTER_NEAREST, dst=values[share])  # type: ignore[call-overload]
    planes = np.asarray(cv2.dnn.blobFromImage(values), dtype=np.float32)  # one for each channel
    return planes.reshape(-1, count, 2, 2, BLOCK)
