"""The rays of a picture's pixels."""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.lens import Lens, Size

from ..scene.scene import Scene


def pixel_grid(size: Size) -> Floats:
    """Centers (h, w, 2) of all pixels [px], (x, y)."""
    x, y = np.meshgrid(np.arange(size[0], dtype=np.float64), np.arange(size[1], dtype=np.float64))
    return np.stack([x, y], axis=-1)


def rays_through(scene: Scene, pixels: Floats) -> Floats:
    """Unit rays (..., 3) in the world frame through pixels (..., 2); NaN outside of the lens's field of view."""
    rays = scene.lens.unproject(pixels.reshape(-1, 2), scene.size)
    rays[~scene.lens.sees(rays)] = np.nan
    return (rays @ scene.orientation.rotation.T).reshape(*pixels.shape[:-1], 3)


def pixel_angle(lens: Lens, size: Size) -> float:
    """Angle [rad] between two neighboring pixels in the middle of a picture of this size (w, h)."""
    middle = np.array([[size[0] / 2.0, size[1] / 2.0], [size[0] / 2.0 + 1.0, size[1] / 2.0]])
    first, second = lens.unproject(middle, size)
    return float(np.arccos(np.clip(first @ second, -1.0, 1.0)))
