"""The reference's three lenses, which are symmetric around their axis: rectilinear, equisolid and equidistant.

theta is the angle [rad] between a ray and the optical axis.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats, Number, numbers_or_nan, one_number
from ..errors import InputError, unknown
from .lens import Lens, Size
from .shape import all_between

if TYPE_CHECKING:
    from typing_extensions import Self  # typing has it from Python 3.11 on

_STRONGEST = 1e6
"""Largest k0 [px^-2] and k1 [px^-4]; real lenses stay far below 1."""


@dataclass(frozen=True, kw_only=True)
class RadialLens(Lens):
    """Base of the reference's three lenses.

    focal_length: focal length [px]. center: image center minus optical center, as x and y [px]. distortion: k0 [px^-2]
    and k1 [px^-4] of r_u = r_d (1 + k0 r_d^2 + k1 r_d^4), from distorted to undistorted radius.

    Raises InputError for a focal length that is not above 0, for numbers that are not finite, and for a distortion
    beyond 1e6.
    """

    focal_length: float
    center: tuple[float, float] = (0.0, 0.0)
    distortion: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "focal_length", one_number(self.focal_length, "lens focal_length"))
        if not (math.isfinite(self.focal_length) and self.focal_length > 0):
            raise InputError(f"lens focal length must be above 0 px, not {self.focal_length}")
        self._store("center", 2)
        if max(map(abs, self._store("distortion", 2))) > _STRONGEST:
            raise InputError(f"lens distortion must be from -{_STRONGEST:g} to {_STRONGEST:g}, not {self.distortion}")

    @property
    def scale(self) -> float:
        return self.focal_length

    @abstractmethod
    def radius(self, theta: Number) -> Number:
        """Undistorted radius [px] at the angle theta [rad]."""

    @abstractmethod
    def angle(self, radius: Number) -> Number:
        """Angle theta [rad] at the undistorted radius [px]; NaN where no angle has it. Inverse of `radius`."""

    @abstractmethod
    def radius_over_sine(self, cosine: Floats) -> Floats:
        """radius(theta) / sin(theta) [px] from cos(theta), without trigonometric functions where the lens allows it."""

    @cached_property
    def limit(self) -> float:
        turning = monotone_radius(self.distortion)
        if math.isinf(turning):
            return self.fov / 2.0
        turning_angle = float(self.angle(undistort(turning, self.distortion)))
        return self.fov / 2.0 if math.isnan(turning_angle) else min(self.fov / 2.0, turning_angle)

    def project(self, rays: Floats, size: Size) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            factor = self.radius_over_sine(rays[:, 0])
            if self.distortion != (0.0, 0.0):
                undistorted = factor * np.hypot(rays[:, 1], rays[:, 2])
                ratio = distort(np.where(np.isfinite(undistorted), undistorted, 0.0), self.distortion) / undistorted
                factor = factor * np.where(undistorted > 0, ratio, 1.0)
            pixels = np.empty((len(rays), 2))
            pixels[:, 0] = self._origin(size)[0] - factor * rays[:, 1]
            pixels[:, 1] = self._origin(size)[1] - factor * rays[:, 2]
        return pixels

    def unproject(self, pixels: Floats, size: Size) -> Floats:
        left, up = (np.asarray(self._origin(size)) - pixels).T
        distorted = np.hypot(left, up)
        reachable = np.where(distorted <= monotone_radius(self.distortion), distorted, np.nan)
        theta = self.angle(undistort(reachable, self.distortion))
        with np.errstate(divide="ignore", invalid="ignore"):
            sine = np.where(distorted > 0, np.sin(theta) / distorted, 0.0)
        return np.stack([np.cos(theta), left * sine, up * sine], axis=1)

    def scaled(self, factor: float, size: Size) -> Self:
        k0, k1 = self.distortion
        return replace(
            self,
            focal_length=self.focal_length * factor,
            center=(self.center[0] * factor, self.center[1] * factor),
            distortion=(k0 / factor**2, k1 / factor**4),
            size=size,
        )

    def _origin(self, size: Size) -> tuple[float, float]:
        return size[0] / 2.0 - self.center[0], size[1] / 2.0 - self.center[1]


class Rectilinear(RadialLens):
    """r = f tan(theta): straight lines stay straight. Its fov must be below pi."""

    @classmethod
    def from_horizontal_fov(cls, fov: float, size: Size) -> Rectilinear:
        """A lens without distortion for images of this size [px], whose width shows the angle fov [rad].

        Raises InputError for an angle outside of (0, pi), and for a size that is not two numbers above 0.
        """
        fov, (width, height) = one_number(fov, "fov"), _two_above_zero(size)
        if not 0.0 < fov < math.pi:
            raise InputError(f"a horizontal angle of view must be above 0 and below pi rad, not {fov}")
        focal_length = 0.5 * width / math.tan(0.5 * fov)
        diagonal = 2.0 * math.atan(0.5 * math.hypot(width, height) / focal_length)
        return cls(focal_length=focal_length, fov=diagonal, size=size)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.fov >= math.pi:
            raise InputError(f"fov of a rectilinear lens must be below pi rad, not {self.fov}")

    def radius(self, theta: Number) -> Number:
        return self.focal_length * np.tan(theta)

    def angle(self, radius: Number) -> Number:
        return np.arctan(radius / self.focal_length)

    def radius_over_sine(self, cosine: Floats) -> Floats:
        return self.focal_length / cosine


class Equisolid(RadialLens):
    """r = 2 f sin(theta / 2): equal solid angles have equal areas in the picture."""

    def radius(self, theta: Number) -> Number:
        return 2.0 * self.focal_length * np.sin(theta / 2.0)

    def angle(self, radius: Number) -> Number:
        with np.errstate(invalid="ignore"):
            return 2.0 * np.arcsin(radius / (2.0 * self.focal_length))

    def radius_over_sine(self, cosine: Floats) -> Floats:
        return self.focal_length * np.sqrt(2.0 / (1.0 + cosine))


class Equidistant(RadialLens):
    """r = f theta: the distance from the image center is proportional to the angle."""

    def radius(self, theta: Number) -> Number:
        return self.focal_length * theta

    def angle(self, radius: Number) -> Number:
        theta = np.asarray(radius / self.focal_length)
        return np.where(theta <= np.pi, theta, np.nan)

    def radius_over_sine(self, cosine: Floats) -> Floats:
        cosine = np.clip(cosine, -1.0, 1.0)
        sine = np.sqrt(1.0 - cosine * cosine)
        ratio = np.arctan2(sine, cosine) / sine
        return self.focal_length * np.where(sine > 1e-12, ratio, 1.0)


def _two_above_zero(size: object) -> tuple[float, float]:
    numbers = numbers_or_nan(size)
    if numbers.shape != (2,) or not all_between(numbers, 0.0, math.inf):
        raise InputError(f"size must be a width and a height above 0 px, not {size!r}")
    width, height = numbers.tolist()
    return width, height


PROJECTIONS: dict[str, type[RadialLens]] = {
    "rectilinear": Rectilinear,
    "equisolid": Equisolid,
    "equidistant": Equidistant,
}


def projection_named(name: str) -> type[RadialLens]:
    """The lens class of a projection name, in either case. Raises InputError for an unknown name."""
    if str(name).lower() not in PROJECTIONS:
        raise InputError(unknown("lens projection", name, PROJECTIONS))
    return PROJECTIONS[str(name).lower()]


def undistort(radius: Number, distortion: tuple[float, float]) -> Number:
    """Undistorted radius r_u = r_d (1 + k0 r_d^2 + k1 r_d^4); radii [px], distortion (k0, k1) [px^-2, px^-4]."""
    k0, k1 = distortion
    square = radius * radius
    return radius * (1.0 + square * (k0 + square * k1))


def distort(radius: Floats, distortion: tuple[float, float]) -> Floats:
    """Distorted radius r_d [px] (n,) from the undistorted one (n,), to 1e-9 px; inverse of `undistort`.

    Newton's method between bounds: a step that would leave the bounds goes to their middle instead. Radii beyond
    `monotone_radius` give the distorted radius there.
    """
    k0, k1 = distortion
    largest = monotone_radius(distortion)
    target = np.minimum(radius, undistort(largest, distortion)) if math.isfinite(largest) else radius
    # A polynomial that always grows is at least 4/9 of its argument everywhere.
    low, high = np.zeros_like(target), np.minimum(2.25 * target, largest)
    distorted = np.minimum(target, high)
    moving = np.ones(target.shape, dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(100):
            square = distorted * distorted
            error = undistort(distorted, distortion) - target
            low, high = np.where(error < 0, distorted, low), np.where(error > 0, distorted, high)
            newton = distorted - error / (1.0 + square * (3.0 * k0 + square * 5.0 * k1))
            better = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
            # Each radius stops on its own iteration. So its digits do not depend on the other radii.
            moving &= np.abs(better - distorted) > 1e-10
            if not moving.any():
                break
            distorted = np.where(moving, better, distorted)
    return distorted


def monotone_radius(distortion: tuple[float, float]) -> float:
    """Distorted radius [px] up to which `undistort` grows; infinity if it grows everywhere."""
    k0, k1 = distortion
    if k0 == 0.0 and k1 == 0.0:
        return math.inf
    # The slope 1 + 3 k0 s + 5 k1 s^2 with s = r_d^2, solved for 1 / s. This stays exact where k0 or k1 is tiny.
    discriminant = 9.0 * k0 * k0 - 20.0 * k1
    if discriminant < 0.0:
        return math.inf
    root = math.sqrt(discriminant)
    largest = (root - 3.0 * k0) / 2.0 if k0 <= 0.0 else -10.0 * k1 / (root + 3.0 * k0)
    return 1.0 / math.sqrt(largest) if largest > 0.0 else math.inf
