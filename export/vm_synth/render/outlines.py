"""The exact outline of a sphere in a picture: where the rays that touch it meet the picture."""

from __future__ import annotations

import math

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.orientation import Orientation


def outline(
    lens: Lens,
    orientation: Orientation,
    center: Floats,
    radius: float,
    size: Size,
    corners: int = 256,
    unseen: bool = False,
) -> Floats:
    """Pixels (corners, 2) of the outline of a sphere around center (3,) [m], as the lens maps it to a picture of this
    size; NaN where the lens does not see it, unless `unseen` asks for that part too. The camera stands over the
    world's origin."""
    toward = (center - np.array([0.0, 0.0, orientation.height])) @ orientation.rotation
    distance = float(np.linalg.norm(toward))
    axis = toward / distance
    side = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    turn = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)[:, None]
    around = np.cos(turn) * side + np.sin(turn) * np.cross(axis, side)
    sine = min(radius / distance, 1.0)
    rays = math.sqrt(1.0 - sine * sine) * axis + sine * around
    pixels = lens.project(rays, size)
    if not unseen:
        pixels[~lens.sees(rays)] = np.nan
    return pixels


def polygon_area(pixels: Floats) -> float:
    """Area [px^2] of a polygon (n, 2), without its corners that are NaN."""
    x, y = pixels[np.isfinite(pixels).all(axis=1)].T
    return float(abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2.0)
