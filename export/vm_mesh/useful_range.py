"""The useful range of a mesh with a lens: pixels and points on an object over its distance.

The paper: a higher resolution reaches farther, a too low one samples a pixel twice (section "Discussion and
Conclusion").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.shapes import Cylinder

from .built_mesh import MeshPlan

_FARTHEST = 1e4  # [m]


@dataclass(frozen=True, eq=False)
class UsefulRange:
    """Pixels and points on an object at distances (m,) [m] from the camera's foot.

    pixels: (m, 2) [px], the size of the object's image across and in the direction of its distance. points: on the
    object. limit: the distance [m] beyond which a step of the mesh is less than a pixel, where neighbors repeat each
    other's colors; infinite if that happens nowhere, 0 if it happens everywhere.
    """

    distances: Floats
    pixels: Floats
    points: float
    limit: float


def useful_range(plan: MeshPlan, scale: float, distances: Floats) -> UsefulRange:
    """The useful range for a lens of `scale` [px/rad] on its axis, with objects at distances (m,) [m]."""
    candidates = np.geomspace(0.01, _FARTHEST, 4001)
    fine = angular_size(plan, candidates).min(axis=1) * scale >= plan.intersections
    # argmin: the first candidate that is not fine.
    limit = math.inf if fine.all() else float(candidates[np.argmin(fine)]) if fine[0] else 0.0
    points = plan.filled_share * plan.intersections**2
    return UsefulRange(distances, angular_size(plan, distances) * scale, points, limit)


def angular_size(plan: MeshPlan, distances: Floats) -> Floats:
    """Angles (m, 2) [rad] that an object at distances (m,) [m] covers: across, and in inclination."""
    shape, h = plan.shape, plan.height
    r = shape.radius
    if isinstance(shape, Cylinder):
        across = 2.0 * np.arcsin(np.minimum(r / np.maximum(distances, r), 1.0))
        foot = np.arctan2(-h, np.maximum(distances - r, 1e-9))
        top = shape.object_height - h  # if it is below the camera, the far edge of the top is the upper outline
        return np.stack([across, np.arctan2(top, distances + (r if top < 0 else -r)) - foot], axis=1)
    away = np.hypot(distances, h - shape.center_height)
    across = 2.0 * np.arcsin(np.minimum(r / away, 1.0))
    if shape.center_height:  # a sphere
        return np.stack([across, across], axis=1)
    return np.stack([across, np.arctan2(distances + r, h) - np.arctan2(distances - r, h)], axis=1)
