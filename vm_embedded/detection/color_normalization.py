"""Colors relative to those of the whole picture.

Halls are dim or bright, and cameras tint them red or blue. A network of a few channels can't separate a dark picture
from a dark object. Nearly all mesh points lie on the field, so their mean color and its deviation measure the light and
the contrast: relative to them every field looks alike.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Mask, Singles

_LEAST_DEVIATION = 0.02
"""Deviation of a picture without contrast: its noise must not become a pattern."""


def normalize_colors(colors: Singles, kind: str, counted: Mask | None = None) -> None:
    """Turn colors (n, 3) from 0 to 1 into those that a network takes, in place.

    kind: one of manifest.POINT_COLORS. "absolute" leaves them. "relative" subtracts each channel's mean over the points
    that are `counted` (n,), by default all, and divides by its standard deviation.

    Sums are in double precision, so the digits don't depend on the order of the points.
    """
    if kind == "absolute":
        return
    for column in colors.T:
        seen = column if counted is None else column[counted]
        if len(seen):
            mean = seen.mean(dtype=np.float64)
            deviation = max(float(seen.std(dtype=np.float64)), _LEAST_DEVIATION)
            column -= np.float32(mean)
            column *= np.float32(1.0 / deviation)
