"""A table or floor as the camera sees it."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Singles

from ..scene.surface import Surface
from .ground import change_per_pixel, share_inside
from .turf import color_patches

_COARSEST = 4  # texels along the side of the coarsest level of a texture


def paint_surface(surface: Surface, points: Floats, range_: Floats, pixel: float) -> tuple[Singles, Singles]:
    """Albedo (h, w, 3) of a table or floor, and the share (h, w) of each pixel that it covers.

    points: where each pixel sees the plane (h, w, 2) [m], infinite above the horizon. range_: distances (h, w) of these
    points from the camera [m]. pixel: angle between neighboring pixels [rad].
    """
    seen = np.isfinite(points[..., 0])
    local = surface.local(np.where(seen[..., None], points, 1e6))
    if surface.is_table:
        depth = surface.depth_inside(local)
        share = share_inside(depth, change_per_pixel(depth)) * seen
    else:
        share = seen.astype(np.float32)
    footprint = np.where(seen, range_ * pixel, 1.0)
    albedo = _sample(surface, local, footprint) * (1.0 + 0.6 * color_patches(surface.seed, points))
    return np.clip(albedo, 0.01, 0.95).astype(np.float32), np.asarray(share, dtype=np.float32)


def _sample(surface: Surface, local: Floats, footprint: Floats) -> Singles:
    """The texture's color (h, w, 3) at local points (h, w, 2) [m], averaged over footprints (h, w) [m]."""
    place = np.mod(local / surface.texture_size, 1.0).astype(np.float32)
    levels = _levels(surface.texture.tobytes(), surface.texture.shape[0])
    texel = surface.texture_size / len(levels[0])
    level = np.clip(np.log2(np.maximum(footprint, 1e-9) / texel), 0.0, len(levels) - 1.0).astype(np.float32)
    found = np.zeros((*level.shape, 3), dtype=np.float32)
    for number, texture in enumerate(levels):
        weight = np.clip(1.0 - np.abs(level - number), 0.0, 1.0)[..., None]
        if weight.any():
            x, y = (place[..., axis] * len(texture) - 0.5 for axis in (0, 1))
            found += weight * cv2.remap(texture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    return found


@lru_cache(maxsize=1)
def _levels(texture: bytes, side: int) -> list[Singles]:
    """A texture (side, side, 3) at a half, a quarter, ... of its resolution, the finest first."""
    levels = [np.frombuffer(texture, dtype=np.float32).reshape(side, side, 3)]
    while len(levels[-1]) > _COARSEST:
        smaller = cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(smaller, dtype=np.float32))
    return levels
