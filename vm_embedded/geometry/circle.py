"""The flat disk: things painted on the plane, for example a penalty spot."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Floats, Mask, Number
from ..errors import GeometryError
from .shape import Shape, all_between, rays_to_circle


class Circle(Shape):
    """A flat disk on the plane (paper: fig:circle_phi).

    Its recursion eqn:circle_phi1 adds the same length 2 r / h to tan(phi) for each object. So the closed form is
    phi(n) = atan(n s) with the spacing s = 2 r / h.
    """

    @property
    def center_height(self) -> float:
        return 0.0

    def spacing(self, height: Number) -> Number:
        if not all_between(height, 0.0, math.inf):
            raise GeometryError(f"camera height must be above 0 m for a circle, not {height} m")
        return 2.0 * self.radius / height  # the term that eqn:circle_phi1 adds

    def height_of(self, spacing: float) -> float:
        return 2.0 * self.radius / spacing

    def phi(self, n: Number, height: Number) -> Number:
        return np.arctan(n * self.spacing(height))  # eqn:circle_phi1, applied n times

    def n(self, phi: Number, height: Number) -> Number:
        return np.tan(phi) / self.spacing(height)

    def theta(self, n: Number, height: Number) -> Number:
        # eqn:circle_dtheta, fig:circle_theta, with the paper's h. The reference takes h - r, which has no real answer
        # just above n = 0.5.
        return self._theta(n, height * np.tan(self.phi(n, height)))

    def offset(self, rays: Floats, centers: Floats, height: float) -> Floats:
        away = np.sqrt(self._squares(rays, centers, height)) / self.radius
        return np.where(rays[:, 2] < 0, away, np.inf)

    def covers(self, rays: Floats, centers: Floats, height: float, share: Number = 1.0) -> Mask:
        # As `offset`, without a root for each pair.
        near = self._squares(rays, centers, height) < (share * self.radius) ** 2
        return np.asarray(near & (rays[:, 2] < 0))

    def _squares(self, rays: Floats, centers: Floats, height: float) -> Floats:
        """Squares (m, n) of the distances [m] of centers from where rays meet the plane."""
        hits = self.center_along(rays, height)
        right, ahead = (hits[:, axis] - centers[:, axis, None] for axis in (0, 1))
        right *= right
        ahead *= ahead
        right += ahead
        return right

    def outline(self, center: Floats, height: float, count: int = 48) -> Floats:
        return rays_to_circle(center, self.radius, np.linspace(0.0, 2.0 * np.pi, count, endpoint=False))
