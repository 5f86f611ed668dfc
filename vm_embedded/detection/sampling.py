"""The colors of the picture at the points of the mesh.

They are the network's input (paper: section "Graph Structure of the Mesh").
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Image, Singles
from .footprint import Levels
from .pyramid import Pyramid

SAMPLINGS = ("exact", "fast")
"""exact: bilinear in floating point. fast: by OpenCV in 8 bits, rounded to whole gray levels and 1/32 px."""

_FOLD = 256  # remap takes tables of at most 32766 a side, so the list of points is folded into rows


def sample(pyramid: Pyramid, pixels: Floats, sampling: str, out: Singles, levels: Levels | None = None) -> None:
    """Write the RGB colors, from 0 to 1, at pixels (n, 2) of the frame into `out` (n, 3).

    sampling: one of SAMPLINGS. levels: the points that each level of the pyramid colors, for footprints. The color is
    arbitrary where one of the four pixels around a point is outside of the image.
    """
    take = _exact if sampling == "exact" else _fast
    with np.errstate(invalid="ignore", over="ignore"):  # pixels outside of the lens's view may be NaN
        if levels is None:
            planes = take(pyramid.level(0), pixels)
            for column, channel in enumerate(pyramid.channels):
                np.multiply(planes[channel], np.float32(1.0 / 255.0), out=out[:, column])
            return
        for level, points in enumerate(levels):
            if len(points):
                image = pyramid.level(level)
                planes = take(image, _in_halved(pixels[points], level, image))
                for column, channel in enumerate(pyramid.channels):
                    out[points, column] = planes[channel] * np.float32(1.0 / 255.0)


def _in_halved(pixels: Floats, level: int, image: Image) -> Floats:
    """Pixels (n, 2) of the whole picture, in `image`, which was halved `level` times; clipped to its border."""
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
