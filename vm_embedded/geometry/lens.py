"""The base class of all lenses. A lens maps rays to pixels and back.

Rays are (n, 3) unit vectors in the camera frame (x forward, y left, z up). Pixels are (n, 2) as (x, y), x to the
right and y down, pixel centers at whole numbers.

The mesh holds rays, and only this map knows the lens. So a network works with lenses that it was not trained on (paper:
section "Discussion and Conclusion").
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats, Mask, numbers_or_nan, one_number
from ..errors import InputError

if TYPE_CHECKING:
    from typing_extensions import Self  # typing has it from Python 3.11 on

Size = tuple[int, int]
"""Width and height of an image [px]."""


@dataclass(frozen=True, kw_only=True)
class Lens(ABC):
    """Maps rays to pixels and back.

    Rays are unit vectors in the camera's frame: x along the optical axis, y to the left, z up. Pixels are (x, y), x to
    the right and y down; the center of the upper left pixel is (0, 0).

    fov [rad]: full angle that the lens covers. size [px]: width and height of the image for which the lens was
    calibrated, or None if its numbers hold unchanged for every image.

    Raises InputError for an angle outside of (0, 2 pi], and for a size that is not two whole numbers of at least 2.
    """

    fov: float
    size: Size | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "fov", one_number(self.fov, "lens fov"))
        if not (math.isfinite(self.fov) and 0.0 < self.fov <= 2.0 * math.pi):
            raise InputError(f"lens fov must be an angle above 0 and up to 2 pi rad, not {self.fov}")
        if self.size is None:
            return
        width, height = self._store("size", 2)
        if min(width, height) < 2 or not (width.is_integer() and height.is_integer()):
            raise InputError(f"lens image size must be whole numbers of at least 2 x 2 px, not {width:g} x {height:g}")
        object.__setattr__(self, "size", (int(width), int(height)))

    def _store(self, name: str, count: int | None = None) -> tuple[float, ...]:
        """Store the finite numbers of a field as a tuple, also those of an array, which would have no hash.

        count: how many there must be, or None for any number. Raises InputError.
        """
        given = getattr(self, name)
        numbers = numbers_or_nan(given).ravel()
        if not np.isfinite(numbers).all() or (count is not None and len(numbers) != count):
            wanted = "finite" if count is None else f"{count} finite"
            raise InputError(f"lens {name} must be {wanted} numbers, not {str(given)[:60]}")
        stored = tuple(numbers.tolist())
        object.__setattr__(self, name, stored)
        return stored

    @abstractmethod
    def project(self, rays: Floats, size: Size) -> Floats:
        """Pixels (n, 2) of rays (n, 3); valid only where `sees` is true."""

    @abstractmethod
    def unproject(self, pixels: Floats, size: Size) -> Floats:
        """Rays (n, 3) through pixels (n, 2); NaN for pixels that no ray reaches. Inverse of `project`."""

    @abstractmethod
    def scaled(self, factor: float, size: Size) -> Self:
        """The same lens for an image that is `factor` times as large and has this size [px]."""

    @property
    @abstractmethod
    def limit(self) -> float:
        """Largest angle from the axis [rad] up to which the lens maps one to one; at most fov / 2."""

    def sees(self, rays: Floats) -> Mask:
        """Whether each ray (n, 3) lies within `limit`; (n,)."""
        return np.asarray(rays[:, 0] > math.cos(self.limit))

    @property
    @abstractmethod
    def scale(self) -> float:
        """Pixels per radian at the axis [px/rad]."""

    def for_image(self, size: Size) -> Self:
        """The lens for an image of this size [px], scaled if its own size differs.

        Raises InputError if the proportions of the two sizes differ by more than one pixel.
        """
        if self.size is None or self.size == size:
            return self
        factor = size[0] / self.size[0]
        if abs(self.size[1] * factor - size[1]) > 1.0:
            raise InputError(
                f"lens is for {self.size[0]} x {self.size[1]} px, but the image has {size[0]} x {size[1]} px and so "
                "other proportions; use an uncropped image from the camera that the lens describes"
            )
        return self.scaled(factor, size)
