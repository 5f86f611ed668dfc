"""Shapes of the target object, by their names: circle, sphere and cylinder (`cylinder.py`).

The paper gives phi as a recursion (`recursion.py`); these are its closed forms, which also hold between whole numbers.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Floats, Number
from ..errors import GeometryError, InputError, unknown
from .cylinder import Cylinder
from .shape import Shape, between, tangents


class Circle(Shape):
    """A flat disk on the plane: phi(n) = atan(2 n r / h), the closed form of `circle_phi1`."""

    @property
    def center_height(self) -> float:
        return 0.0

    def spacing(self, height: Number) -> Number:
        if not between(height, 0.0, math.inf):
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
        return self._theta(n, height * np.tan(self.phi(n, height)))


class Sphere(Shape):
    """A ball on the plane: phi(n) = atan(sinh(-n ln(1 - 2 r / h))), the closed form of `sphere_phi_1`."""

    @property
    def center_height(self) -> float:
        return self.radius

    def spacing(self, height: Number) -> Number:
        if not between(height, 2.0 * self.radius, math.inf):
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
        return self._theta(n, (height - self.radius) * np.tan(self.phi(n, height)))


SHAPES: dict[str, type[Shape]] = {"circle": Circle, "sphere": Sphere, "cylinder": Cylinder}


def shape_named(name: str, radius: float, object_height: float = 0.0) -> Shape:
    """Shape from its name, one of SHAPES, its radius [m] and, of a cylinder, its height [m].

    Raises InputError for an unknown name or a height where none belongs, GeometryError for lengths that are none.
    """
    if name.lower() not in SHAPES:
        raise InputError(unknown("shape", name, SHAPES))
    kind = SHAPES[name.lower()]
    if issubclass(kind, Cylinder):
        return kind(radius, object_height)
    if object_height:
        raise InputError(f"only a cylinder has a height of its own, a {name.lower()} no {object_height:g} m")
    return kind(radius)
