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
        x, y = self.positions.T
        return np.asarray(np.sqrt(x * x + y * y))

    @cached_property
    def azimuths(self) -> Floats:
        """Direction (n,) [rad] on the plane, counterclockwise from `ahead`: -pi and pi are behind the camera."""
        x, y = self.ahead
        ahead, left = np.array([[x, y], [-y, x]]) @ self.positions.T
        return np.asarray(np.arctan2(left.astype(np.float32), ahead.astype(np.float32)), dtype=np.float64)

    def directions(self, azimuths: Floats) -> Floats:
        """Unit vectors (m, 2) at azimuths (m,) [rad]."""
        (x, y), c, s = self.ahead, np.cos(azimuths), np.sin(azimuths)
        return np.array([c * x - s * y, c * y + s * x]).T

    def along(self, ranges: Floats) -> Floats:
        """Distance [m] to the next ring of points, along the ray, at these ranges [m]."""
        return np.asarray(np.sqrt(ranges**2 + self.height**2) * (self.across / self.height))


def starts_of_runs(numbers: npt.NDArray[np.number[Any]]) -> Chosen:
    """Positions in numbers (n,), at least one, where runs of equal numbers start."""
    return np.flatnonzero(np.concatenate([[True], numbers[1:] != numbers[:-1]]))
