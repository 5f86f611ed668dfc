"""The kinds of lenses that vm-detect knows, each as a vector of numbers that a fit can change.

The vector starts with the logarithms of the focal lengths, because these must stay above 0, and with the optical
center. All lengths are divided by half the diagonal of the picture, so that one step of any number matters about as
much as that of another.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.calibrated_lenses import BrownLens, CalibratedLens, FisheyeLens
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, RadialLens, Rectilinear

FLAT_FOV, WIDE_FOV = math.radians(160.0), 2.0 * math.pi
"""Fields of view of rectilinear and of other lenses during a fit [rad]; the first is that of calibration files."""


def half_diagonal(size: Size) -> float:
    """Distance of the corners of a picture of this size from its center [px]."""
    return math.hypot(*size) / 2.0


@dataclass(frozen=True)
class LensKind(ABC):
    """A kind of lens whose numbers can be fitted. focal_count: number of its focal lengths, 1 or 2."""

    focal_count: int

    @abstractmethod
    def lens(self, numbers: Floats, size: Size) -> Lens:
        """The lens with these numbers, for pictures of this size [px]."""

    @abstractmethod
    def start(self, focal_length: float, size: Size) -> Floats:
        """The numbers of a lens without distortion, with this focal length [px] and a centered axis."""

    def focal_lengths(self, numbers: Floats, size: Size) -> Floats:
        """Focal lengths (focal_count,) [px]."""
        return np.asarray(np.exp(numbers[: self.focal_count]) * half_diagonal(size))

    def center(self, numbers: Floats, size: Size) -> Floats:
        """Optical center (2,) as x and y [px]."""
        offset = numbers[self.focal_count : self.focal_count + 2] * half_diagonal(size)
        return np.asarray(_middle(size) + offset)

    def coefficients(self, numbers: Floats) -> Floats:
        """The numbers of the distortion, as the fit scales them."""
        return numbers[self.focal_count + 2 :]

    def _start(self, focal_length: float, size: Size, coefficients: int) -> Floats:
        numbers = np.zeros(self.focal_count + 2 + coefficients)
        numbers[: self.focal_count] = math.log(focal_length / half_diagonal(size))
        return numbers


@dataclass(frozen=True)
class RadialKind(LensKind):
    """One of the reference's lenses, with k0 and k1."""

    model: type[RadialLens]

    def lens(self, numbers: Floats, size: Size) -> RadialLens:
        unit = half_diagonal(size)
        k0, k1 = (float(each) for each in self.coefficients(numbers))
        x, y = np.array(size) / 2.0 - self.center(numbers, size)
        return self.model(
            fov=FLAT_FOV if self.model is Rectilinear else WIDE_FOV,
            size=size,
            focal_length=float(self.focal_lengths(numbers, size)[0]),
            center=(float(x), float(y)),
            distortion=(k0 / unit**2, k1 / unit**4),
        )

    def start(self, focal_length: float, size: Size) -> Floats:
        return self._start(focal_length, size, 2)


@dataclass(frozen=True)
class CalibratedKind(LensKind):
    """One of OpenCV's lenses. count: number of coefficients of its distortion."""

    model: type[CalibratedLens]
    count: int

    def lens(self, numbers: Floats, size: Size) -> CalibratedLens:
        fx, fy = (float(each) for each in self.focal_lengths(numbers, size))
        cx, cy = (float(each) for each in self.center(numbers, size))
        return self.model(
            fov=FLAT_FOV if self.model is BrownLens else WIDE_FOV,
            size=size,
            focal_lengths=(fx, fy),
            optical_center=(cx, cy),
            coefficients=tuple(float(each) for each in self.coefficients(numbers)),
        )

    def start(self, focal_length: float, size: Size) -> Floats:
        return self._start(focal_length, size, self.count)


LENS_KINDS: dict[str, LensKind] = {
    "pinhole": CalibratedKind(2, BrownLens, 5),
    "fisheye": CalibratedKind(2, FisheyeLens, 4),
    "rectilinear": RadialKind(1, Rectilinear),
    "equisolid": RadialKind(1, Equisolid),
    "equidistant": RadialKind(1, Equidistant),
}


def with_fov_of_picture(lens: Lens, size: Size) -> Lens:
    """A radial lens with the field of view that reaches the corners of the picture; any other lens unchanged.

    Files of calibrated lenses have no field of view. The angle has a margin of 1 %, and ends where the lens does.
    """
    if not isinstance(lens, RadialLens):
        return lens
    angle = picture_angle(lens, size)
    return replace(lens, fov=min(2.02 * angle, lens.fov))


def picture_angle(lens: Lens, size: Size) -> float:
    """Largest angle from the axis [rad] of a pixel on the edge of the picture that the lens reaches."""
    width, height = size
    across, down = np.linspace(-0.5, width - 0.5, 65), np.linspace(-0.5, height - 0.5, 65)
    edge = [(x, y) for x in across for y in (down[0], down[-1])] + [
        (x, y) for x in (across[0], across[-1]) for y in down
    ]
    rays = lens.unproject(np.array(edge), size)
    forward = rays[np.isfinite(rays).all(axis=1), 0]
    return lens.limit if len(forward) < len(edge) else min(float(np.arccos(forward.min().clip(-1.0, 1.0))), lens.limit)


def _middle(size: Size) -> Floats:
    """The middle of a picture [px]; pixel centers are at whole numbers."""
    return (np.array(size, dtype=np.float64) - 1.0) / 2.0
