"""The colors of the picture at the points of the mesh: the network's input (paper: section "Graph Structure of the
Mesh").

On a graph, they are bilinear in floating point. On a canvas, all cells of a strip stand for areas of about the same
size, so one call of OpenCV and one picture of the pyramid color them. OpenCV rounds colors to whole gray levels.
Networks on a canvas see far around each cell and don't depend on a level; in return, this takes a quarter of the time.

Halls are dim or bright, and cameras tint them red or blue. A network of a few channels can't separate a dark picture
from a dark object. Nearly all mesh points lie on the field, so their mean color and its deviation measure the light and
the contrast: relative to them every field looks alike.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Image, Mask, Singles
from ..network.canvas_layout import CanvasLayout
from .footprint import BLOCK, Levels
from .pyramid import Pyramid

_LEAST_DEVIATION = 0.02
"""Deviation of a picture without contrast: its noise must not become a pattern."""


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


def normalized_canvas(canvas: Image, channels: tuple[int, int, int], kind: str, counted: Mask) -> Singles:
    """The same from the colors of a canvas (rows, columns[, channels]), from 0 to 255: (3, n).

    channels: positions of red, green and blue. counted (n,): see `normalized`. Sums are exact.
    """
    planes = np.asarray(cv2.dnn.blobFromImage(canvas, 1.0 / 255.0), dtype=np.float32).reshape(-1, len(counted))
    if kind == "relative" and counted.any():
        mean, deviation = cv2.meanStdDev(canvas, mask=counted.view(np.uint8).reshape(canvas.shape[:2]))
        planes -= (mean / 255.0).astype(np.float32)
        planes *= (1.0 / np.maximum(deviation / 255.0, _LEAST_DEVIATION)).astype(np.float32)
    return planes[list(channels)]


def sample_strips(pyramid: Pyramid, pixels: Floats, levels: Levels, layout: CanvasLayout, on_screen: Mask) -> Image:
    """Colors of a canvas (rows, columns[, channels]), from pixels (n, 2) of the mesh's points.

    levels: which picture of the pyramid colors each point. on_screen (n,): the other points, and cells without a point,
    have an arbitrary color.
    """
    shape = layout.shape
    canvas = np.zeros((*shape, *pyramid.level(0).shape[2:]), dtype=np.uint8)
    shown = layout.spread(on_screen).reshape(shape)
    with np.errstate(over="ignore"):
        places = [layout.spread(each).reshape(shape) for each in pixels.T.astype(np.float32)]
    for piece in layout.pieces:
        region = piece.region
        if shown[region].any():
            level = int(levels.halvings[piece.point])
            scale = np.float32(0.5**level)
            # Pixels count from the middle of the first one.
            x, y = (each[region] * scale + (scale - np.float32(1.0)) * np.float32(0.5) for each in places)
            canvas[region] = pyramid.at(level, x, y, shown[region])
    return canvas
