"""Lenses with radial symmetry: rectilinear, equisolid and equidistant.

Rays are (n, 3) unit vectors in the camera frame (x forward, y left, z up). Pixels are (n, 2) as (x, y), x to the
right and y down, pixel centers at whole numbers. theta is the angle [rad] between a ray and the optical axis.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from ..arrays import Floats, Mask, Number
from ..errors import InputError, unknown

Size = tuple[int, int]
"""Width and height of an image [px]."""


@dataclass(frozen=True, kw_only=True)
class Lens(ABC):
    """Maps rays to pixels and back.

    `fov` is the full angle [rad] that the lens covers. `size` is the image size that its numbers are for, or None if
    they hold as they are for every image.
    """

    fov: float
    size: Size | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.fov) and 0.0 < self.fov <= 2.0 * math.pi):
            raise InputError(f"lens fov must be an angle above 0 and up to 2 pi rad, not {self.fov}")
        if self.size is not None and min(self.size) < 2:
            raise InputError(f"lens image size must be at least 2 x 2 px, not {self.size[0]} x {self.size[1]}")

    @abstractmethod
    def project(self, rays: Floats, size: Size) -> Floats:
        """Pixels (n, 2) of rays (n, 3); without meaning where `sees` is false."""

    @abstractmethod
    def unproject(self, pixels: Floats, size: Size) -> Floats:
        """Rays (n, 3) through pixels (n, 2); NaN for pixels that no ray reaches."""

    @abstractmethod
    def scaled(self, factor: float, size: Size) -> Self:
        """The same lens on an image `factor` times as large."""

    @property
    @abstractmethod
    def limit(self) -> float:
        """Largest angle from the axis [rad] that the lens maps one to one, at most fov / 2."""

    def sees(self, rays: Floats) -> Mask:
        """Which rays (n, 3) lie within the limit."""
        return np.asarray(rays[:, 0] > math.cos(self.limit))

    @property
    @abstractmethod
    def scale(self) -> float:
        """Pixels for each radian on the axis [px/rad]."""

    def for_image(self, size: Size) -> Self:
        """The lens for an image of this size: scaled if its own has the same proportions.

        Raises InputError if the proportions differ by more than one pixel.
        """
        if self.size is None or self.size == size:
            return self
        factor = size[0] / self.size[0]
        if abs(self.size[1] * factor - size[1]) > 1.0:
            raise InputError(
                f"lens is for {self.size[0]} x {self.size[1]} px and the image has {size[0]} x {size[1]} px: "
                "other proportions, so it was cropped or is from another camera"
            )
        return self.scaled(factor, size)


def undistort(radius: Number, distortion: tuple[float, float]) -> Number:
    """Undistorted radius r_u = r_d (1 + k0 r_d^2 + k1 r_d^4), radii in [px]."""
    k0, k1 = distortion
    square = radius * radius
    return radius * (1.0 + square * (k0 + square * k1))


def distort(radius: Floats, distortion: tuple[float, float]) -> Floats:
    """Distorted radius r_d [px], the inverse of `undistort`, to 1e-9 px.

    Newton's method, kept between bounds: where it would leave them the middle is taken. Radii that no pixel has are
    taken for the largest one that there is.
    """
    k0, k1 = distortion
    largest = monotone_radius(distortion)
    target = np.minimum(radius, undistort(largest, distortion)) if math.isfinite(largest) else radius
    # A polynomial that always grows never falls below 4/9 of the identity.
    low, high = np.zeros_like(target), np.minimum(2.25 * target, largest)
    distorted = np.minimum(target, high)
    moving = np.ones(target.shape, dtype=bool)
    for _ in range(100):
        square = distorted * distorted
        error = undistort(distorted, distortion) - target
        low, high = np.where(error < 0, distorted, low), np.where(error > 0, distorted, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = distorted - error / (1.0 + square * (3.0 * k0 + square * 5.0 * k1))
        better = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
        # Each radius stops by itself, so that its digits don't depend on the others.
        moving &= np.abs(better - distorted) > 1e-10
        if not moving.any():
            break
        distorted = np.where(moving, better, distorted)
    return distorted


def distort_series(radius: Number, distortion: tuple[float, float]) -> Number:
    """The reference's own inverse, four terms of the series in r_u^2; for comparison only.

    Its authors claim about 0.2 px, which holds for mild distortion only.
    """
    k0, k1 = distortion
    terms = (
        -k0,
        3.0 * k0**2 - k1,
        -12.0 * k0**3 + 8.0 * k0 * k1,
        55.0 * k0**4 - 55.0 * k0**2 * k1 + 5.0 * k1**2,
    )
    square = radius * radius
    factor = 0.0
    for term in reversed(terms):
        factor = (factor + term) * square
    return radius * (1.0 + factor)


def monotone_radius(distortion: tuple[float, float]) -> float:
    """Distorted radius [px] up to which `undistort` grows; infinity if it always does."""
    k0, k1 = distortion
    if k0 == 0.0 and k1 == 0.0:
        return math.inf
    roots = np.roots([5.0 * k1, 3.0 * k0, 1.0]) if k1 else np.array([-1.0 / (3.0 * k0)])
    turning = [root.real for root in roots if abs(root.imag) < 1e-12 * abs(root) and root.real > 0]
    return math.sqrt(min(turning)) if turning else math.inf


@dataclass(frozen=True, kw_only=True)
class RadialLens(Lens):
    """Base of the reference's three lenses.

    `focal_length` [px]; `center` is the image center minus the optical center [px]; `distortion` (k0, k1)
    [px^-2, px^-4] as in `undistort`.
    """

    focal_length: float
    center: tuple[float, float] = (0.0, 0.0)
    distortion: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (math.isfinite(self.focal_length) and self.focal_length > 0):
            raise InputError(f"lens focal length must be above 0 px, not {self.focal_length}")
        if not np.isfinite([*self.center, *self.distortion]).all():
            raise InputError(f"lens center {self.center} and distortion {self.distortion} must be finite numbers")

    @property
    def scale(self) -> float:
        return self.focal_length

    @abstractmethod
    def radius(self, theta: Number) -> Number:
        """Undistorted radius [px] at the angle theta [rad]."""

    @abstractmethod
    def angle(self, radius: Number) -> Number:
        """Angle theta [rad] at the undistorted radius [px]; inverse of `radius`, NaN beyond its reach."""

    @abstractmethod
    def radius_over_sine(self, cosine: Floats) -> Floats:
        """radius(theta) / sin(theta) [px] from cos(theta): the projection without trigonometry where there is one."""

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
                ratio = distort(np.nan_to_num(undistorted, posinf=0.0), self.distortion) / undistorted
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

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.fov >= math.pi:
            raise InputError(f"a rectilinear lens covers less than pi rad, not {self.fov}")

    def radius(self, theta: Number) -> Number:
        return self.focal_length * np.tan(theta)

    def angle(self, radius: Number) -> Number:
        return np.arctan(radius / self.focal_length)

    def radius_over_sine(self, cosine: Floats) -> Floats:
        return self.focal_length / cosine


class Equisolid(RadialLens):
    """r = 2 f sin(theta / 2): equal areas for equal solid angles."""

    def radius(self, theta: Number) -> Number:
        return 2.0 * self.focal_length * np.sin(theta / 2.0)

    def angle(self, radius: Number) -> Number:
        with np.errstate(invalid="ignore"):
            return 2.0 * np.arcsin(radius / (2.0 * self.focal_length))

    def radius_over_sine(self, cosine: Floats) -> Floats:
        return self.focal_length * np.sqrt(2.0 / (1.0 + cosine))


class Equidistant(RadialLens):
    """r = f theta: equal radii for equal angles."""

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


PROJECTIONS: dict[str, type[RadialLens]] = {
    "rectilinear": Rectilinear,
    "equisolid": Equisolid,
    "equidistant": Equidistant,
}


def projection_named(name: str) -> type[RadialLens]:
    """The lens class of a projection name, in either case."""
    if str(name).lower() not in PROJECTIONS:
        raise InputError(unknown("lens projection", name, PROJECTIONS))
    return PROJECTIONS[str(name).lower()]
