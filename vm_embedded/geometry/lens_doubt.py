"""Signs that the numbers of a lens do not belong to its images, for example because they are in other units."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .lens import Lens, Size
from .radial_lenses import RadialLens

_OFF_CENTER, _OUTSIDE = 0.25, 0.5
"""Distance of the optical center from the middle of the image, as a share of its width and height. More than the first
in both directions, or than the second in one, is strange."""

_SMALLEST_CIRCLE = 0.25
"""Least diameter of what a lens shows, as a share of the image's shorter side. The circles of fisheyes are larger. With
a focal length in mm, or in widths of the image, it is about a hundredth."""


@dataclass(frozen=True)
class LensDoubt:
    """seen: what is strange about a lens. remedy: what to check."""

    seen: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.seen}: {self.remedy}"


def lens_doubt(lens: Lens, size: Size) -> LensDoubt | None:
    """Why a lens is probably wrong; None if it may be right. size: of its images [px], if the lens has none."""
    width, height = size = lens.size or size
    x, y = lens.project(np.array([[1.0, 0.0, 0.0]]), size)[0].tolist()
    near, far = sorted((abs(x / width - 0.5), abs(y / height - 0.5)))
    if near > _OFF_CENTER or far > _OUTSIDE:
        return _center_doubt(lens, (x, y), size)
    diameter = _diameter(lens, size)
    if diameter < _SMALLEST_CIRCLE * min(size):
        return LensDoubt(
            f"the lens shows a circle of {diameter:.3g} px in a picture of {width} x {height} px",
            "check focal_length or camera_matrix, which are in px, not in mm, and fov [rad]",
        )
    return None


def _center_doubt(lens: Lens, center: tuple[float, float], size: Size) -> LensDoubt:
    """What is wrong with a lens with this optical center [px]."""
    if isinstance(lens, RadialLens):
        return LensDoubt(
            f"center {list(lens.center)} px is far from the middle of the picture",
            "center is the picture's middle minus the optical center, [0, 0] if they are the same; correct the lens",
        )
    return LensDoubt(
        f"the optical center ({center[0]:g}, {center[1]:g}) px is far from the middle of a picture of "
        f"{size[0]} x {size[1]} px",
        "camera_matrix must be in px, for images of the lens's size",
    )


def _diameter(lens: Lens, size: Size) -> float:
    """Diameter of the circle that a lens can show [px]; NaN where the lens has no answer."""
    along, across = math.cos(0.999 * lens.limit), math.sin(0.999 * lens.limit)
    edge = np.array([[along, across, 0.0], [along, -across, 0.0], [along, 0.0, across], [along, 0.0, -across]])
    return float(np.ptp(lens.project(edge, size), axis=0).max())
