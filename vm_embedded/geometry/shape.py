"""What a shape of the target object has to say: how densely it must be sampled, seen from a height.

`n` counts objects from straight below the camera outwards: n = 0 is the nadir, and an object that lies between
phi(n) and phi(n + 1) fills that gap exactly.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Number
from ..errors import GeometryError


@dataclass(frozen=True)
class Shape(ABC):
    """An object of radius `radius` [m] that lies on the observation plane.

    Every method takes the camera's height over the plane [m] and raises GeometryError where the shape has no mesh.
    """

    radius: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.radius) and self.radius > 0):
            raise GeometryError(f"object radius must be a positive number of metres, not {self.radius}")

    @property
    @abstractmethod
    def center_height(self) -> float:
        """Height of the object's center over the plane [m]."""

    @abstractmethod
    def spacing(self, height: Number) -> Number:
        """The one number through which the height enters: phi depends on n * spacing alone."""

    @abstractmethod
    def height_of(self, spacing: float) -> float:
        """The height [m] that has this spacing; inverse of `spacing`."""

    @abstractmethod
    def phi(self, n: Number, height: Number) -> Number:
        """Inclination [rad] from straight below, n objects out."""

    @abstractmethod
    def n(self, phi: Number, height: Number) -> Number:
        """Objects between straight below and the inclination phi [rad]; inverse of `phi`."""

    @abstractmethod
    def theta(self, n: Number, height: Number) -> Number:
        """Angular width [rad] of an object around the vertical, n objects out.

        Below n = 0.5 the object covers the nadir; there the width grows linearly to the whole circle, as in the
        reference.
        """

    @abstractmethod
    def offset(self, rays: Floats, centers: Floats, height: float) -> Floats:
        """How far rays (n, 3) pass from objects at `centers` (m, 3), in units of the object's outline: (m, n).

        0 is the object's center, 1 its outline. Rays are unit vectors below the horizon or not, centers [m] are
        relative to the camera, both in the observation-plane frame.
        """

    @abstractmethod
    def outline(self, center: Floats, height: float, count: int = 48) -> Floats:
        """Unit rays (count, 3) around the outline of the object at `center` (3,) [m], relative to the camera."""

    def center_along(self, rays: Floats, height: float) -> Floats:
        """Centers (n, 3) [m], relative to the camera, of objects on the plane that rays (n, 3) point at.

        Rays on or above the horizon give centers as far out as numbers go (1e6 heights).
        """
        depth = np.maximum(-rays[:, 2:], 1e-6)
        return np.asarray(rays * ((height - self.center_height) / depth))

    def intersection_ratio(self, height: float, mesh_height: float) -> float:
        """Rings that cross an object at `height`, over those at `mesh_height`, for a mesh made for `mesh_height`."""
        return float(self.spacing(height) / self.spacing(mesh_height))

    def _theta(self, n: Number, distance: Number) -> Number:
        """theta of an object whose axis is so far [m] from the vertical, n objects out."""
        n = np.asarray(n, dtype=np.float64)
        with np.errstate(divide="ignore", over="ignore"):
            sine = self.radius / np.abs(distance)
        beyond = 2.0 * np.arcsin(np.minimum(sine, 1.0))
        return np.where(n <= 0.5, 2.0 * np.pi / (1.0 + 2.0 * n), beyond)


def between(value: Number, low: float, high: float) -> bool:
    """Whether a number, or every one of an array, lies between two others."""
    inside = (value > low) & (value < high)
    return inside if isinstance(inside, bool) else bool(np.all(inside))


def tangents(axis: Floats) -> Floats:
    """Two unit vectors (2, 3) that are orthogonal to the unit vector `axis` (3,) and to each other."""
    x, y, z = (float(value) for value in axis)
    level = math.hypot(x, y)
    across_x, across_y = (-y / level, x / level) if level > 1e-9 else (1.0, 0.0)
    return np.array([[across_x, across_y, 0.0], [-z * across_y, z * across_x, x * across_y - y * across_x]])
