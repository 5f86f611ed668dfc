"""Colors relative to those of the whole picture.

Halls are dim or bright, and cameras tint them red or blue. A network of a few channels can't separate a dark picture
from a dark object. Nearly all mesh points lie on the field, so their mean color and its deviation measure the light and
the contrast: relative to them every field looks alike.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import Image, Mask, Singles

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
