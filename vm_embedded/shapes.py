"""Shapes of the target object: how densely it must be sampled, seen from a height.

`n` counts objects from straight below the camera outwards: n = 0 is the nadir, and an object that lies between
phi(n) and phi(n + 1) fills that gap exactly. The paper gives phi as a recursion (`recursion.py`); these are its
closed forms, which also hold between whole numbers.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from .arrays import Floats, Number
from .errors import GeometryError, InputError, unknown


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

    def _theta(self, n: Number, tangent_height: Number, height: Number) -> Number:
        n = np.asarray(n, dtype=np.float64)
        with np.errstate(divide="ignore", over="ignore"):
            sine = self.radius / (tangent_height * np.tan(self.phi(n, height)))
        beyond = 2.0 * np.arcsin(np.minimum(sine, 1.0))
        return np.where(n <= 0.5, 2.0 * np.pi / (1.0 + 2.0 * n), beyond)


class Circle(Shape):
    """A flat disk on the plane: phi(n) = atan(2 n r / h), the closed form of `circle_phi1`."""

    @property
    def center_height(self) -> float:
        return 0.0

    def spacing(self, height: Number) -> Number:
        if not _between(height, 0.0, math.inf):
            raise GeometryError(f"camera height must be above 0 m for a circle, not {height} m")
        return 2.0 * self.radius / height

    def height_of(self, spacing: float) -> float:
        return 2.0 * self.radius / spacing

    def phi(self, n: Number, height: Number) -> Number:
        return np.arctan(n * self.spacing(height))

    def offset(self, rays: Floats, centers: Floats, height: float) -> Floats:
        hits = self.center_along(rays, height)[:, :2]
        away = np.linalg.norm(hits[None] - centers[:, None, :2], axis=2) / self.radius
        return np.where(rays[:, 2] < 0, away, np.inf)

    def outline(self, center: Floats, height: float, count: int = 48) -> Floats:
        around = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        points = np.tile(center, (count, 1))
        points[:, 0] += self.radius * np.cos(around)
        points[:, 1] += self.radius * np.sin(around)
        return np.asarray(points / np.linalg.norm(points, axis=1, keepdims=True))

    def n(self, phi: Number, height: Number) -> Number:
        return np.tan(phi) / self.spacing(height)

    def theta(self, n: Number, height: Number) -> Number:
        # The paper's h, not the reference's h - r, which has no real answer just above n = 0.5.
        return self._theta(n, height, height)


class Sphere(Shape):
    """A ball on the plane: phi(n) = atan(sinh(-n ln(1 - 2 r / h))), the closed form of `sphere_phi_1`."""

    @property
    def center_height(self) -> float:
        return self.radius

    def spacing(self, height: Number) -> Number:
        if not _between(height, 2.0 * self.radius, math.inf):
            raise GeometryError(
                f"camera height must be above the ball's diameter, {2.0 * self.radius:g} m, not {height} m"
            )
        return -np.log1p(-2.0 * self.radius / height)

    def height_of(self, spacing: float) -> float:
        return 2.0 * self.radius / -math.expm1(-spacing)

    def phi(self, n: Number, height: Number) -> Number:
        return np.arctan(np.sinh(n * self.spacing(height)))

    def offset(self, rays: Floats, centers: Floats, height: float) -> Floats:
        distance = np.linalg.norm(centers, axis=1, keepdims=True)
        cosine = np.sqrt(np.maximum(1.0 - (self.radius / distance) ** 2, 0.0))
        # Chords instead of angles: proportional to them within the few degrees of a ball, and no trigonometry.
        return np.asarray(np.sqrt(np.maximum(1.0 - (centers / distance) @ rays.T, 0.0) / (1.0 - cosine)))

    def outline(self, center: Floats, height: float, count: int = 48) -> Floats:
        distance = float(np.linalg.norm(center))
        axis = center / distance
        sine = min(self.radius / distance, 1.0)
        around = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        ring = np.stack([np.cos(around), np.sin(around)], axis=1) @ tangents(axis)
        return np.asarray(math.sqrt(1.0 - sine * sine) * axis + sine * ring)

    def n(self, phi: Number, height: Number) -> Number:
        return np.arcsinh(np.tan(phi)) / self.spacing(height)

    def theta(self, n: Number, height: Number) -> Number:
        return self._theta(n, height - self.radius, height)


def _between(value: Number, low: float, high: float) -> bool:
    """Whether a number, or every one of an array, lies between two others."""
    inside = (value > low) & (value < high)
    return inside if isinstance(inside, bool) else bool(np.all(inside))


def tangents(axis: Floats) -> Floats:
    """Two unit vectors (2, 3) that are orthogonal to the unit vector `axis` (3,) and to each other."""
    x, y, z = (float(value) for value in axis)
    level = math.hypot(x, y)
    across_x, across_y = (-y / level, x / level) if level > 1e-9 else (1.0, 0.0)
    return np.array([[across_x, across_y, 0.0], [-z * across_y, z * across_x, x * across_y - y * across_x]])


SHAPES: dict[str, type[Shape]] = {"circle": Circle, "sphere": Sphere}


def shape_named(name: str, radius: float) -> Shape:
    """Shape from its name, "circle" or "sphere", and radius [m]."""
    if name.lower() not in SHAPES:
        raise InputError(unknown("shape", name, SHAPES))
    return SHAPES[name.lower()](radius)
