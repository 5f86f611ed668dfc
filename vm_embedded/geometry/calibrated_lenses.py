"""Lenses as OpenCV and ROS calibrate them: plumb_bob and rational (Brown-Conrady), and fisheye (Kannala-Brandt)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..errors import InputError
from .lens import Lens, Size

if TYPE_CHECKING:
    from typing_extensions import Self  # typing has it from Python 3.11 on


@dataclass(frozen=True, kw_only=True)
class CalibratedLens(Lens):
    """Base of the calibrated lenses.

    focal_lengths: fx and fy [px]. optical_center: cx and cy [px]. coefficients: of the distortion, in OpenCV's order.

    Raises InputError for focal lengths that are not above 0 and for numbers that are not finite.
    """

    focal_lengths: tuple[float, float]
    optical_center: tuple[float, float]
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        self._store("optical_center", 2)
        self._store("coefficients")
        if min(self._store("focal_lengths", 2)) <= 0:
            raise InputError(f"focal lengths must be above 0 px, not {self.focal_lengths}")

    @property
    def scale(self) -> float:
        return math.sqrt(self.focal_lengths[0] * self.focal_lengths[1])

    def scaled(self, factor: float, size: Size) -> Self:
        # Scaling keeps the corner of the picture in place. It lies at -0.5, as pixel centers are at whole numbers.
        return replace(
            self,
            focal_lengths=(self.focal_lengths[0] * factor, self.focal_lengths[1] * factor),
            optical_center=(
                (self.optical_center[0] + 0.5) * factor - 0.5,
                (self.optical_center[1] + 0.5) * factor - 0.5,
            ),
            size=size,
        )

    def _pixels(self, right: Floats, down: Floats) -> Floats:
        """Pixels (n, 2) from distorted coordinates (n,) to the right and down, at focal length 1."""
        return np.stack(
            [
                self.focal_lengths[0] * right + self.optical_center[0],
                self.focal_lengths[1] * down + self.optical_center[1],
            ],
            axis=1,
        )

    def _normalized(self, pixels: Floats) -> Floats:
        """Distorted coordinates (n, 2) at focal length 1; inverse of `_pixels`."""
        return np.asarray((pixels - np.asarray(self.optical_center)) / np.asarray(self.focal_lengths))


class BrownLens(CalibratedLens):
    """A rectilinear lens with OpenCV's distortion (k1, k2, p1, p2[, k3[, k4, k5, k6]]): Brown-Conrady.

    ROS calls it plumb_bob, or rational_polynomial with eight coefficients.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.coefficients) not in (0, 4, 5, 8):
            raise InputError(
                f"a plumb_bob or rational lens needs 0, 4, 5 or 8 coefficients, not {len(self.coefficients)}"
            )
        if self.fov >= math.pi:
            raise InputError(f"fov of a rectilinear lens must be below pi rad, not {self.fov}")

    @cached_property
    def limit(self) -> float:
        # Beyond its turning point the polynomial, in tan(theta), would fold outer rays back into the picture. The
        # tangential part moves a point by up to 3 r^2 |p| towards the center, and `unproject` halves its error in each
        # round only where the rest grows twice as fast.
        tangent = np.linspace(0.0, math.tan(self.fov / 2.0), 4096)
        shift = 6.0 * math.hypot(*self.coefficients[2:4]) if self.coefficients else 0.0
        return math.atan(_growing_until(lambda r: r * self._radial(r * r) - shift * r * r, tangent))

    def _radial(self, square: Floats) -> Floats:
        """Distorted radius over undistorted radius (n,), without the tangential part, from the squared radius (n,)."""
        k1, k2, _, _, k3, k4, k5, k6 = (*self.coefficients, *(0.0,) * (8 - len(self.coefficients)))
        numerator = 1.0 + square * (k1 + square * (k2 + square * k3))
        return numerator / (1.0 + square * (k4 + square * (k5 + square * k6)))

    def _tangential(self, flat: Floats) -> Floats:
        """Shift (n, 2) of undistorted coordinates (n, 2), caused by a lens that is not quite parallel to its sensor."""
        p1, p2 = self.coefficients[2:4] if self.coefficients else (0.0, 0.0)
        right, down = flat[:, 0], flat[:, 1]
        cross, square = 2.0 * right * down, right * right + down * down
        return np.stack(
            [p1 * cross + p2 * (square + 2.0 * right * right), p2 * cross + p1 * (square + 2.0 * down * down)], axis=1
        )

    def project(self, rays: Floats, size: Size) -> Floats:
        with np.errstate(all="ignore"):
            flat = -rays[:, 1:] / rays[:, :1]
            radial = self._radial((flat * flat).sum(axis=1))
            distorted = flat * radial[:, None] + self._tangential(flat)
        return self._pixels(distorted[:, 0], distorted[:, 1])

    def unproject(self, pixels: Floats, size: Size) -> Floats:
        distorted = self._normalized(pixels)
        table = np.linspace(0.0, math.tan(self.limit), 4096)
        radii = table * self._radial(table * table), table
        undistorted = distorted
        for _ in range(20):  # subtract the shift at the last estimate; converges because the tangential shift is small
            undistorted = self._without_radial(distorted - self._tangential(undistorted), radii)
        rays = np.column_stack([np.ones(len(pixels)), -undistorted])
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))

    def _without_radial(self, distorted: Floats, radii: tuple[Floats, Floats]) -> Floats:
        """Coordinates (n, 2) without their radial distortion; NaN beyond the limit.

        radii: a table of distorted and undistorted ones (m,) up to the limit.
        """
        radius = np.hypot(distorted[:, 0], distorted[:, 1])
        found = np.interp(radius, *radii, right=np.nan)
        for _ in range(4):  # Newton's method, starting from the table's value
            step = 1e-6
            value, ahead = ((r * self._radial(r * r)) for r in (found, found + step))
            found = found - (value - radius) * step / (ahead - value)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(distorted * np.where(radius > 0, found / radius, 1.0)[:, None])


class FisheyeLens(CalibratedLens):
    """Kannala-Brandt: r = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8) at focal length 1.

    OpenCV calls it fisheye, ROS equidistant.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.coefficients) not in (0, 4):
            raise InputError(f"a fisheye lens needs 0 or 4 coefficients, not {len(self.coefficients)}")

    @cached_property
    def limit(self) -> float:
        return _growing_until(self._distort, np.linspace(0.0, self.fov / 2.0, 4096))

    def _polynomial(self) -> Floats:
        """Coefficients of r(theta), highest power first."""
        powers = np.zeros(10)
        powers[8] = 1.0
        for power, coefficient in zip((6, 4, 2, 0), self.coefficients, strict=False):
            powers[power] = coefficient
        return powers

    def _distort(self, theta: Floats) -> Floats:
        return np.asarray(np.polyval(self._polynomial(), theta))

    def project(self, rays: Floats, size: Size) -> Floats:
        sine = np.hypot(rays[:, 1], rays[:, 2])
        radius = self._distort(np.arctan2(sine, rays[:, 0]))
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where(sine > 1e-12, radius / sine, 1.0)
        return self._pixels(-factor * rays[:, 1], -factor * rays[:, 2])

    def unproject(self, pixels: Floats, size: Size) -> Floats:
        normalized = self._normalized(pixels)
        radius = np.hypot(normalized[:, 0], normalized[:, 1])
        # Newton's method, starting from the value in a table.
        table = np.linspace(0.0, self.limit, 1024)
        theta = np.interp(radius, self._distort(table), table, right=np.nan)
        slope = np.polyder(self._polynomial())
        for _ in range(10):
            theta = theta - (self._distort(theta) - radius) / np.polyval(slope, theta)
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where(radius > 0, np.sin(theta) / radius, 0.0)
        return np.stack([np.cos(theta), -factor * normalized[:, 0], -factor * normalized[:, 1]], axis=1)


def _growing_until(radius: Callable[[Floats], Floats], steps: Floats) -> float:
    """The last of `steps` (n,) up to which `radius` is sure to grow.

    The true maximum may lie on either side of the step with the largest value, so the result is the step before that.
    """
    with np.errstate(all="ignore"):
        growing = np.diff(radius(steps)) > 0
    return float(steps[-1] if growing.all() else steps[max(int(np.argmin(growing)) - 1, 0)])
