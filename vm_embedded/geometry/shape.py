"""The base class of the target object's shapes: how densely to sample an object, seen from a height.

`n` counts objects from straight below the camera outwards: n = 0 is the nadir, and an object that lies between
phi(n) and phi(n + 1) fills that gap exactly. The paper's section "Visual Mesh Geometry" defines phi and theta.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Mask, Number, one_number
from ..errors import GeometryError


@dataclass(frozen=True)
class Shape(ABC):
    """An object of radius `radius` [m] that lies on the observation plane.

    `n` is a distance on the plane, counted in objects that lie in a row: n = 0 is straight below the camera.
    All methods take the camera's height over the plane [m]. `spacing` and the methods that use it raise GeometryError
    for a camera that is too low for the shape.
    """

    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", one_number(self.radius, "object radius"))
        if not (math.isfinite(self.radius) and self.radius > 0):
            raise GeometryError(f"object radius must be a positive number of meters, not {self.radius}")

    @property
    @abstractmethod
    def center_height(self) -> float:
        """Height of the object's center over the plane [m]."""

    @property
    def half_size(self) -> float:
        """Half of its longest side [m]: its radius, or half its height if that is more."""
        return max(self.radius, self.center_height)

    @abstractmethod
    def spacing(self, height: Number) -> Number:
        """The spacing s for a camera height [m]. phi depends on the height only through n * s."""

    @abstractmethod
    def height_of(self, spacing: float) -> float:
        """The height [m] that has this spacing; inverse of `spacing`."""

    @abstractmethod
    def phi(self, n: Number, height: Number) -> Number:
        """Angle [rad] between straight down and the ray to the end of a row of n objects (fig:geometry)."""

    @abstractmethod
    def n(self, phi: Number, height: Number) -> Number:
        """Number of objects between the nadir and the angle phi [rad]; inverse of `phi`."""

    @abstractmethod
    def theta(self, n: Number, height: Number) -> Number:
        """Azimuth angle (around the vertical) [rad] that an object covers, at the distance of n objects.

        It is Delta theta in the paper's fig:geometry.

        Up to n = 0.5 the object covers the nadir. There the angle is 2 pi / (1 + 2 n), as in the reference: the whole
        circle at the nadir and pi at n = 0.5.
        """

    @abstractmethod
    def offset(self, rays: Floats, centers: Floats, height: float) -> Floats:
        """Distance (m, n) of rays from objects, relative to their outline: 0 at the center, 1 on the outline.

        rays: (n, 3) unit vectors from the camera. centers: (m, 3) of the objects, relative to the camera [m]. Both are
        in one frame whose z is up.
        """

    def covers(self, rays: Floats, centers: Floats, height: float, share: Number = 1.0) -> Mask:
        """Whether the offset of rays (n, 3) from objects at `centers` (m, 3) is less than `share`; (m, n).

        share: a number, or an array (s, 1, 1) of them, which gives (s, m, n).
        """
        return np.asarray(self.offset(rays, centers, height) < share)

    @abstractmethod
    def outline(self, center: Floats, height: float, count: int = 48) -> Floats:
        """Unit rays (count, 3) around the outline of the object at `center` (3,) [m], relative to the camera."""

    def center_along(self, rays: Floats, height: float) -> Floats:
        """Centers (n, 3) [m], relative to the camera, of objects on the plane in the directions of rays (n, 3).

        For a ray on or above the horizon, the center is a million camera heights away.
        """
        depth = np.maximum(-rays[:, 2:], 1e-6)
        return np.asarray(rays * ((height - self.center_height) / depth))

    def _theta(self, n: Number, distance: Number) -> Number:
        """theta of an object n objects out whose axis is at this distance [m] from the vertical (eqn:circle_dtheta)."""
        n = np.asarray(n, dtype=np.float64)
        with np.errstate(divide="ignore", over="ignore"):
            sine = self.radius / np.abs(distance)
        beyond = 2.0 * np.arcsin(np.minimum(sine, 1.0))
        # Up to n = 0.5 the paper's equation has a singularity (section "Circle").
        return np.where(n <= 0.5, 2.0 * np.pi / (1.0 + 2.0 * n), beyond)


def all_between(value: Number, low: float, high: float) -> bool:
    """Whether a number, or every number of an array, lies between two others, limits excluded."""
    inside = (value > low) & (value < high)
    return inside if isinstance(inside, bool) else bool(np.all(inside))


def rays_to_circle(center: Floats, radius: float, angles: Floats) -> Floats:
    """Unit rays (m, 3) to a level circle around `center` (3,) [m], relative to the camera, at angles (m,) [rad]."""
    points = np.tile(center, (len(angles), 1))
    points[:, 0] += radius * np.cos(angles)
    points[:, 1] += radius * np.sin(angles)
    return np.asarray(points / np.linalg.norm(points, axis=1, keepdims=True))


def tangents(axis: Floats) -> Floats:
    """Unit vectors (2, 3), orthogonal to the unit vector `axis` (3,) and to each other: a level one, then upwards."""
    x, y, z = (float(value) for value in axis)
    level = math.hypot(x, y)
    across_x, across_y = (-y / level, x / level) if level > 1e-9 else (1.0, 0.0)
    return np.array([[across_x, across_y, 0.0], [-z * across_y, z * across_x, x * across_y - y * across_x]])
