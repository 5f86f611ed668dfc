"""How evenly a mesh samples: points on an object over its distance and bearing, and how the links lie.

Links are measured in steps: an object is k steps across, in the direction of its distance and at right angles to it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError
from vm_embedded.geometry.cylinder import Cylinder
from vm_embedded.mesh.walls import NEAREST

from .made_mesh import MadeMesh

BEARINGS = 61
"""Bearings at which objects are put, spread over the whole turn in step with no ring."""


@dataclass(frozen=True, eq=False)
class OnObject:
    """Points on objects over distances (m,) [m]: mean, low and high (m,) of the equivalent k over all bearings.

    The equivalent k is the side of a square lattice that would put as many points on the object: sqrt(4 N / pi) for
    circles and spheres. Of wall6 it counts the points of the wall whose distance is nearest in ratio, row by row.
    """

    distances: Floats
    mean: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation."""

    mean: float
    deviation: float

    @classmethod
    def of(cls, values: Floats) -> Spread:
        """Of finite values; NaN of none."""
        return cls(float(values.mean()), float(values.std())) if len(values) else cls(np.nan, np.nan)


@dataclass(frozen=True)
class Links:
    """radial: length of the links from a point to its neighbors [steps]. cyclic: from one neighbor to the next around
    the point [steps]. angular: angle between them [deg]. In an even mesh of six neighbors they are 1, 1 and 60 or, with
    square cells, sqrt(2) and less for some."""

    radial: Spread
    cyclic: Spread
    angular: Spread


def on_object(made: MadeMesh, distances: Floats) -> OnObject:
    """The equivalent k on objects at distances (m,) [m] from the camera's foot; of wall6 at those that it serves.

    Raises InputError if it serves none.
    """
    plan, rays = made.plan, np.ascontiguousarray(made.mesh.rays)
    if made.walls is not None:
        distances = distances[distances >= NEAREST]
        if len(distances) == 0:
            raise InputError(f"wall6 begins at {NEAREST:g} m; give a greater --distance or --max-distance")
    turn = 2.0 * np.pi * (np.arange(BEARINGS) + 0.37) / BEARINGS
    found = np.empty((len(distances), BEARINGS))
    for row, distance in enumerate(distances.tolist()):
        centers = np.empty((BEARINGS, 3))
        centers[:, 0], centers[:, 1] = distance * np.cos(turn), distance * np.sin(turn)
        centers[:, 2] = plan.shape.center_height - plan.height
        chosen = np.arange(len(rays))
        if made.walls is not None:
            chosen = np.flatnonzero(made.walls == _serving_wall(made, distance))
        hits = plan.shape.offset(rays[chosen], centers, plan.height) < 1.0
        found[row] = np.sqrt(hits.sum(axis=1) / plan.whole)
    return OnObject(distances, found.mean(axis=1), found.min(axis=1), found.max(axis=1))


def links_of(made: MadeMesh, low: float, high: float) -> Links:
    """How the links lie of points that are meant for distances from `low` to `high` [m] and lack no neighbor."""
    mesh, plan = made.mesh, made.plan
    whole = (mesh.neighbors[:-1] < len(mesh)).all(axis=1)
    points = np.flatnonzero(whole & (made.distances >= low) & (made.distances <= high))
    rays = mesh.rays[points]
    beside = mesh.rays[mesh.neighbors[points]]  # (m, N, 3)
    outward, around = _frame(rays)
    away = beside - rays[:, None]
    vectors = np.stack([np.einsum("mni,mi->mn", away, outward), np.einsum("mni,mi->mn", away, around)], axis=2)
    vectors *= plan.intersections / np.stack(_extent(made, points), axis=1)[:, None]
    length = np.linalg.norm(vectors, axis=2)
    after = np.roll(vectors, -1, axis=1)
    gap = np.linalg.norm(after - vectors, axis=2)
    cross = vectors[:, :, 0] * after[:, :, 1] - vectors[:, :, 1] * after[:, :, 0]
    angle = np.degrees(np.abs(np.arctan2(cross, (vectors * after).sum(axis=2))))
    return Links(*(Spread.of(each.ravel()) for each in (length, gap, angle)))


def _serving_wall(made: MadeMesh, distance: float) -> int:
    """The wall whose steps fit an object at a distance [m] best."""
    assert made.walls is not None
    first = np.flatnonzero(np.diff(made.walls, prepend=-1))
    return int(np.argmin(np.abs(made.distances[first] / distance - 1.0)))


def _frame(rays: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (m, 3) at right angles to rays (m, 3): towards greater inclination, and around the vertical."""
    level = np.hypot(rays[:, 0], rays[:, 1])
    x = np.where(level > 1e-12, rays[:, 0] / np.maximum(level, 1e-12), 1.0)
    y = np.where(level > 1e-12, rays[:, 1] / np.maximum(level, 1e-12), 0.0)
    around = np.stack([-y, x, np.zeros(len(rays))], axis=1)
    outward = np.stack([-rays[:, 2] * x, -rays[:, 2] * y, level], axis=1)
    return outward, around


def _extent(made: MadeMesh, points: np.ndarray) -> tuple[Floats, Floats]:
    """Angle [rad] that an object fills where each point (m,) is: in inclination, and across."""
    plan, shape = made.plan, made.plan.shape
    rays, distance = made.mesh.rays[points], made.distances[points]
    if made.walls is not None:
        assert isinstance(shape, Cylinder)
        low, high = np.arctan2(-plan.height, distance), np.arctan2(shape.object_height - plan.height, distance)
        level = np.hypot(rays[:, 0], rays[:, 1])
        return np.asarray(high - low), 2.0 * np.arcsin(shape.radius / distance) * level
    n = shape.n(np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), -rays[:, 2]), plan.height)
    inclination = np.asarray(shape.phi(n + 0.5, plan.height)) - np.asarray(shape.phi(n - 0.5, plan.height))
    away = np.hypot(distance, plan.height - shape.center_height)
    return inclination, 2.0 * np.arcsin(np.minimum(shape.radius / away, 1.0))
