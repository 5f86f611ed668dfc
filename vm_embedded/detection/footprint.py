"""How much of the picture a point of the mesh stands for.

Between two rings near the camera lie many pixels. A point that takes the color of one of them sees a blade of grass or
a stroke of a print, by chance; a ball at one meter looks like noise, at six like a ball. A network for footprints gets
the mean color around each point instead, from a picture that was halved until its pixels are as large as the mesh is
wide there, so that an object looks alike at every distance.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import Floats
from ..geometry.shape import Shape

Levels = tuple[npt.NDArray[np.intp], ...]
"""Of each picture, the whole one first and then each half as large as the one before, the points that it colors."""

_MOST = 7
"""Halvings after which nothing is left of a picture."""


def levels_of(rays: Floats, shape: Shape, height: float, intersections: float, scale: float) -> Levels:
    """Which points (n,) with rays (n, 3) of a mesh are colored by which picture.

    The mesh: for a shape, seen from a height [m], with so many rings across an object. At an inclination phi the object
    is r / (h - c) cos(phi) in radius as an angle, with c the height of its center, so rings are 2 r cos(phi) /
    (k (h - c)) apart; for a circle, which lies flat, that is the distance within a ring. scale: of the lens on its axis
    [px/rad].
    """
    widest = 2.0 * shape.radius * scale / (intersections * (height - shape.center_height))
    width = widest * np.maximum(np.nan_to_num(-rays[:, 2]), 0.0)
    level = np.clip(np.floor(np.log2(np.maximum(width, 1.0))), 0, _MOST).astype(np.intp)
    return tuple(np.flatnonzero(level == each) for each in range(int(level.max(initial=0)) + 1))


def alike(count: int, width: float) -> Levels:
    """The same for `count` points that are all as wide apart [px]."""
    level = int(np.clip(np.floor(np.log2(max(width, 1.0))), 0, _MOST))
    return (*(np.empty(0, dtype=np.intp) for _ in range(level)), np.arange(count))
