"""The ball."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Floats, Mask, Number
from ..errors import GeometryError
from .shape import Shape, all_between, tangents


class Sphere(Shape):
    """A ball on the plane (paper: fig:sphere_phi).

    The closed form of its recursion eqn:sphere_phi_1 is phi(n) = atan(sinh(n s)) with the spacing
    s = -ln(1 - 2 r / h). It also holds for fractions n, so ring i is simply at phi(i / k). The paper
    uses smaller spheres for this.
    """

    @property
    def center_height(self) -> float:
        return self.radius

    def spacing(self, height: Number) -> Number:
        if not all_between(height, 2.0 * self.radius, math.inf):
            raise GeometryError(
                f"camera height must be above the ball's diameter, {2.0 * self.radius:g} m, not {np.min(height):g} m"
            )
        return -np.log1p(-2.0 * self.radius / height)  # what eqn:sphere_phi_1 adds to asinh(tan(phi))

    def height_of(self, spacing: float) -> float:
        return 2.0 * self.radius / -math.expm1(-spacing)

    def phi(self, n: Number, height: Number) -> Number:
        # eqn:sphere_phi_1, applied n times. Fractions of n replace the paper's smaller spheres
        # (fig:multi_sphere_intersections).
        return np.arctan(np.sinh(n * self.spacing(height)))

    def n(self, phi: Number, height: Number) -> Number:
        return np.arcsinh(np.tan(phi)) / self.spacing(height)

    def theta(self, n: Number, height: Number) -> Number:
        # eqn:circle_dtheta (paper: section "Sphere") at the height of the ball's center, h - r, as in the reference.
        return self._theta(n, (height - self.radius) * np.tan(self.phi(n, height)))

    def offset(self, rays: Floats, centers: Floats, height: float) -> Floats:
        distance = np.linalg.norm(centers, axis=1, keepdims=True)
        cosine = np.sqrt(np.maximum(1.0 - (self.radius / distance) ** 2, 0.0))
        # Chords instead of angles: they are proportional within the few degrees of a ball, and need no trigonometry.
        return np.asarray(np.sqrt(np.maximum(1.0 - (centers / distance) @ rays.T, 0.0) / (1.0 - cosine)))

    def covers(self, rays: Floats, centers: Floats, height: float, share: Number = 1.0) -> Mask:
        # As `offset`, without a root for each pair: the chord's square is compared.
        distance = np.linalg.norm(centers, axis=1, keepdims=True)
        cosine = np.sqrt(np.maximum(1.0 - (self.radius / distance) ** 2, 0.0))
        return np.asarray((centers / distance) @ rays.T > 1.0 - share * share * (1.0 - cosine))

    def outline(self, center: Floats, height: float, count: int = 48) -> Floats:
        distance = float(np.linalg.norm(center))
        axis = center / distance
        sine = min(self.radius / distance, 1.0)
        around = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        ring = np.stack([np.cos(around), np.sin(around)], axis=1) @ tangents(axis)
        return np.asarray(math.sqrt(1.0 - sine * sine) * axis + sine * ring)
