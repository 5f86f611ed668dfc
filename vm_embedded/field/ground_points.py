"""Mesh points as places on the plane, with the probabilities of the classes of a soccer field."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Chosen, Floats, Singles

ROLES = ("goal", "robot", "line", "field")
"""Names of the classes that field features are made of."""


@dataclass(frozen=True, eq=False)
class GroundPoints:
    """The n points of a frame below the horizon, from near to far.

    positions (n, 2) [m]: where their rays meet the plane, relative to the point below the camera, in the frame of
    Detection. A point on something that stands on the plane has the place behind it, where its ray would end. height:
    of the camera over the plane [m]. across: distance between neighboring points across the ray [m]; the same
    everywhere. classes: probabilities (n,) of each class of ROLES that the network has. outside: probability (n,) of
    the classes that are neither the field nor anything on it. ahead (2,): unit vector in the camera's direction.
    """

    positions: Floats
    height: float
    across: float
    classes: dict[str, Singles]
    outside: Singles
    ahead: Floats

    @cached_property
    def ranges(self) -> Floats:
        """Distance (n,) [m] on the plane from the point below the camera."""
        return np.hypot(self.positions[:, 0], self.positions[:, 1])

    @cached_property
    def azimuths(self) -> Floats:
        """Direction (n,) [rad] on the plane, counterclockwise from `ahead`: -pi and pi are behind the camera."""
        x, y = self.ahead
        return np.asarray(np.arctan2(self.positions @ (-y, x), self.positions @ self.ahead))

    def directions(self, azimuths: Floats) -> Floats:
        """Unit vectors (m, 2) at azimuths (m,) [rad]."""
        (x, y), c, s = self.ahead, np.cos(azimuths), np.sin(azimuths)
        return np.stack([c * x - s * y, c * y + s * x], axis=-1)

    def along(self, ranges: Floats) -> Floats:
        """Distance [m] to the next ring of points, along the ray, at these ranges [m]."""
        return np.asarray(self.across * np.hypot(ranges, self.height) / self.height)


def cross(a: Floats, b: Floats) -> Floats:
    """Cross product (...,) of vectors (..., 2) on the plane: positive if b is to the left of a."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def split(columns: npt.NDArray[np.integer[Any]], values: Floats) -> tuple[Chosen, Floats]:
    """For each column of points, sorted from near to far, the place that best parts positive from negative values.

    columns (n,): number of each point's column, sorted. values (n,). Returns for each column that occurs the position
    of the last point before the best split, or -1 if all values are better behind it, and the sum of the values there.
    For one column with the values 1, 1, -1, -1 these are 1 and 2.
    """
    starts = np.flatnonzero(np.diff(columns, prepend=-1))
    counts = np.diff(np.append(starts, len(values)))
    sums = np.cumsum(values)
    sums = sums - np.repeat(sums[starts] - values[starts], counts)
    best = np.maximum.reduceat(sums, starts)
    last = np.maximum.reduceat(np.where(sums == np.repeat(best, counts), np.arange(len(values)), -1), starts)
    return np.where(best > 0.0, last, -1), best
