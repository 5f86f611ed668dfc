"""How far out a mesh is worth its points, given a lens: pixels and points on an object against its distance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.cylinder import Cylinder

from .made_mesh import Plan

_FARTHEST = 1e4  # [m]


@dataclass(frozen=True, eq=False)
class Range:
    """Over distances (m,) from the camera's foot [m]: pixels across the object and, where it reaches less far there,
    in the direction of its distance (m, 2) [px], and points on it (m,).

    worth: distance [m] from which on a mesh step is less than a pixel, so that neighbors repeat each other's colors;
    the farthest that is worth configuring. Infinite or 0 if it is so nowhere or everywhere.
    """

    distances: Floats
    pixels: Floats
    points: float
    worth: float


def range_of(plan: Plan, scale: float, distances: Floats) -> Range:
    """What a camera with a lens of `scale` [px/rad] on its axis sees of objects at distances (m,) [m]."""
    candidates = np.geomspace(0.01, _FARTHEST, 4001)
    fine = extent(plan, candidates).min(axis=1) * scale >= plan.intersections
    worth = math.inf if fine.all() else float(candidates[np.argmin(fine)]) if fine[0] else 0.0
    return Range(distances, extent(plan, distances) * scale, plan.whole * plan.intersections**2, worth)


def extent(plan: Plan, distances: Floats) -> Floats:
    """Angles (m, 2) [rad] that an object fills at distances (m,) [m]: across, and in inclination."""
    shape, h = plan.shape, plan.height
    r = shape.radius
    if isinstance(shape, Cylinder):
        across = 2.0 * np.arcsin(np.minimum(r / np.maximum(distances, r), 1.0))
        foot = np.arctan2(-h, np.maximum(distances - r, 1e-9))
        top = shape.object_height - h
        return np.stack([across, np.arctan2(top, distances + (r if top < 0 else -r)) - foot], axis=1)
    away = np.hypot(distances, h - shape.center_height)
    across = 2.0 * np.arcsin(np.minimum(r / away, 1.0))
    if shape.center_height:
        return np.stack([across, across], axis=1)
    return np.stack([across, np.arctan2(distances + r, h) - np.arctan2(distances - r, h)], axis=1)
