"""The upright cylinder: goal posts, robots, legs.

The paper names it as a shape that could be added (section "Visual Mesh Geometry").

Each object stands where the shadow of the one before it ends, for a light at the camera. Let t = tan(phi) be the slope
to the near foot of a cylinder of radius r and height H. Its shadow ends at the slope (h t + 2 r) / (h - H). This
recursion has the fixed point t = -2 r / H and the closed form t(n) = (2 r / H) (e^(n s) - 1) with s = -ln(1 - H / h).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Number, one_number
from ..errors import GeometryError
from .shape import Shape, all_between, rays_to_circle


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder of height `object_height` [m] that stands on the plane.

    phi, n and theta need a camera above its top. For lower cameras use mesh model wall6 (`mesh/walls.py`).
    """

    object_height: float

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "object_height", one_number(self.object_height, "object_height"))
        if not (math.isfinite(self.object_height) and self.object_height > 0):
            raise GeometryError(f"cylinder height must be a number above 0 m, not {self.object_height}")

    @property
    def center_height(self) -> float:
        return self.object_height / 2.0

    def spacing(self, height: Number) -> Number:
        if not all_between(height, self.object_height, math.inf):
            raise GeometryError(
                f"camera height must be above the cylinder's top, {self.object_height:g} m, not {height} m; "
                "for objects as high as the camera or higher, use mesh model wall6"
            )
        return -np.log1p(-self.object_height / height)

    def height_of(self, spacing: float) -> float:
        return self.object_height / -math.expm1(-spacing)

    def phi(self, n: Number, height: Number) -> Number:
        slope = 2.0 * self.radius / self.object_height
        return np.arctan(np.sign(n) * slope * np.expm1(np.abs(n) * self.spacing(height)))

    def n(self, phi: Number, height: Number) -> Number:
        slope = 2.0 * self.radius / self.object_height
        return np.sign(phi) * np.log1p(np.abs(np.tan(phi)) / slope) / self.spacing(height)

    def theta(self, n: Number, height: Number) -> Number:
        # The near foot of the cylinder n objects out is at phi(n - 1/2), its axis one radius farther.
        slope = 2.0 * self.radius / self.object_height
        foot = np.expm1((np.asarray(n) - 0.5) * self.spacing(height))
        return self._theta(n, self.radius + slope * height * foot)

    def offset(self, rays: Floats, centers: Floats, height: float) -> Floats:
        # Seen from above, the part of a ray at the heights of the object is a line. It runs from `first` to `last`, in
        # units of the ray's length. Its distance from the object's axis decides whether the ray hits the object.
        top, bottom = self.object_height - height, -height
        down = np.where(rays[:, 2] == 0.0, -1e-12, rays[:, 2])
        first, last = np.sort(np.stack([top / down, bottom / down]), axis=0)
        across = rays[:, :2]
        length = np.maximum(np.einsum("ni,ni->n", across, across), 1e-24)
        nearest = np.clip(centers[:, :2] @ across.T / length, np.maximum(first, 0.0), np.maximum(last, 0.0))
        away = nearest[:, :, None] * across - centers[:, None, :2]
        offset = np.linalg.norm(away, axis=2) / self.radius
        return np.where(last > 0.0, offset, np.inf)

    def outline(self, center: Floats, height: float, count: int = 48) -> Floats:
        away = math.hypot(center[0], center[1])
        above = height > self.object_height
        if away <= self.radius:
            if not above:
                raise GeometryError(
                    f"a camera at a height of {height:g} m is inside of the cylinder whose axis is {away:g} m away"
                )
            return self._edge(center, np.linspace(0.0, 2.0 * np.pi, count, endpoint=False), top=True)
        # The outline follows the near part of the lower circle. It continues along the far part of the upper circle if
        # the camera sees the top, and along its near part otherwise.
        toward = math.atan2(-center[1], -center[0])
        half = math.acos(self.radius / away)
        low, high = count - count // 2, count // 2
        near = toward + np.linspace(-half, half, low)
        upper = toward + (np.linspace(half, 2.0 * np.pi - half, high) if above else np.linspace(half, -half, high))
        return np.concatenate([self._edge(center, near, top=False), self._edge(center, upper, top=True)])

    def _edge(self, center: Floats, angles: Floats, top: bool) -> Floats:
        """Unit rays (m, 3) to points of the upper or lower circle at these angles (m,) [rad]."""
        up = self.center_height if top else -self.center_height
        return rays_to_circle(center + np.array([0.0, 0.0, up]), self.radius, angles)
