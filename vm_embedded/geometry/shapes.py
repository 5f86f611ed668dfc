"""The shapes: ball, disk and upright cylinder, and their names in model files and configurations.

A disk is a thing painted on the plane, for example a penalty spot. The paper names the cylinder, of goal posts, robots
and legs, as a shape that could be added (section "Visual Mesh Geometry").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Mask, Number, one_number
from ..errors import GeometryError, InputError, unknown
from .shape import Shape, all_between, rays_to_circle, tangents


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


SHAPES: dict[str, type[Shape]] = {"circle": Circle, "sphere": Sphere, "cylinder": Cylinder}


def make_shape(name: str, radius: float, object_height: float = 0.0) -> Shape:
    """The shape of this name (one of SHAPES, in either case) and radius [m].

    object_height: height of a cylinder [m]; 0 for all other shapes.

    Raises InputError for an unknown name or for a height of another shape than a cylinder, and GeometryError for a
    length that is not a positive number.
    """
    if name.lower() not in SHAPES:
        raise InputError(unknown("shape", name, SHAPES))
    kind = SHAPES[name.lower()]
    if issubclass(kind, Cylinder):
        return kind(radius, object_height)
    if object_height:
        raise InputError(
            f"only a cylinder takes an object height; remove the height {object_height:g} m from the {name.lower()}"
        )
    return kind(radius)
