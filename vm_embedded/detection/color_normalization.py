"""Colors relative to those of the whole picture.

Halls are dim or bright, cameras see them reddish or blue, and a network of a few channels has nothing to tell a dark
picture from a dark thing. Nearly all points of the mesh lie on the field, so their mean color and its deviation say
what light there is and how much it shows: relative to them a field looks alike everywhere.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Mask, Singles

COLORINGS = ("absolute", "relative")
"""Colors that a network takes. absolute: from 0 to 1. relative: less their mean over the picture's points, as a part of
their standard deviation, each channel by itself."""

_LEAST = 0.02
"""Deviation of a picture that shows nothing: its noise must not become a pattern."""


def make_relative(colors: Singles, counted: Mask | None = None) -> None:
    """Make absolute colors (n, 3) relative, in place, to those that are `counted` (n,), or to all of them.

    Sums are in double precision, so that digits don't depend on how the points lie in memory.
    """
    for column in colors.T:
        seen = column if counted is None else column[counted]
        if len(seen):
            mean = seen.mean(dtype=np.float64)
            deviation = max(float(seen.std(dtype=np.float64)), _LEAST)
            column -= np.float32(mean)
            column *= np.float32(1.0 / deviation)
