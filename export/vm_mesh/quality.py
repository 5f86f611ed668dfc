"""How evenly a mesh samples: points on an object over its distance and bearing, and lengths and angles of links.

Lengths of links are in steps: an object is k steps across, both in the direction of its distance and at right angles
to it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError
from vm_embedded.geometry.shapes import Cylinder
from vm_embedded.mesh.walls import NEAREST

from .built_mesh import BuiltMesh

BEARINGS = 61
"""Number of bearings of an object, evenly spread; a prime, so that it shares no divisor with the number of points of a
ring."""


@dataclass(frozen=True, eq=False)
class PointsOnObject:
    """The equivalent k of an object at distances (m,) [m]: mean, low and high (m,) over all bearings.

    N points on a circle or sphere have the equivalent k = sqrt(4 N / pi): a square lattice with k points across the
    object has N points on it. In wall6 only the points of the nearest wall count, by the ratio of distances.
    """

    distances: Floats
    mean: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation; NaN without values."""

    mean: float
    deviation: float

    @classmethod
    def of(cls, values: Floats) -> Spread:
        """The spread of finite values."""
        return cls(float(values.mean()), float(values.std())) if len(values) else cls(np.nan, np.nan)


@dataclass(frozen=True)
class Links:
    """Lengths and angles of the links of a mesh.

    radial: length of the links from a point to its neighbors [steps]. cyclic: distance from one neighbor to the next
    around the point [steps]. angular: angle between two neighbors in turn [deg]. An even mesh of six neighbors has 1, 1
    and 60.
    """

    radial: Spread
    cyclic: Spread
    angular: Spread


@dataclass(frozen=True, eq=False)
class Quality:
    """How evenly a mesh samples."""

    points: PointsOnObject
    links: Links

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        names = ("distances", "mean", "low", "high")
        points = {name: np.round(getattr(self.points, name), 4).tolist() for name in names}
        return {"on_object": points, "links": asdict(self.links)}


def measure_quality(built: BuiltMesh, distances: Floats) -> Quality:
    """The quality of a mesh for objects at distances (m,) [m] and, for links, in the first 80 % of its reach."""
    return Quality(points_on_object(built, distances), measure_links(built, 0.0, 0.8 * built.plan.max_distance))


def points_on_object(built: BuiltMesh, distances: Floats) -> PointsOnObject:
    """The equivalent k of objects at distances (m,) [m] from the camera's foot; wall6 leaves out those too near for it.

    Raises InputError if no distance is left.
    """
    plan, rays = built.plan, np.ascontiguousarray(built.mesh.rays)
    if built.walls is not None:
        distances = distances[distances >= NEAREST]
        if len(distances) == 0:
            raise InputError(f"wall6 begins at {NEAREST:g} m; give a greater --distance or --max-distance")
    bearings = 2.0 * np.pi * (np.arange(BEARINGS) + 0.37) / BEARINGS  # not at 0, where each ring has its first point
    found = np.empty((len(distances), BEARINGS))
    for row, distance in enumerate(distances.tolist()):
        centers = np.empty((BEARINGS, 3))
        centers[:, 0], centers[:, 1] = distance * np.cos(bearings), distance * np.sin(bearings)
        centers[:, 2] = plan.shape.center_height - plan.height
        chosen = np.arange(len(rays))
        if built.walls is not None:
            chosen = np.flatnonzero(built.walls == _nearest_wall(built, distance))
        hits = plan.shape.offset(rays[chosen], centers, plan.height) < 1.0
        found[row] = np.sqrt(hits.sum(axis=1) / plan.filled_share)
    return PointsOnObject(distances, found.mean(axis=1), found.min(axis=1), found.max(axis=1))


def measure_links(built: BuiltMesh, low: float, high: float) -> Links:
    """The links of points that have all neighbors and serve distances from `low` to `high` [m]."""
    mesh, plan = built.mesh, built.plan
    complete = (mesh.neighbors[:-1] < len(mesh)).all(axis=1)
    points = np.flatnonzero(complete & (built.distances >= low) & (built.distances <= high))
    rays = mesh.rays[points]
    to_neighbors = mesh.rays[mesh.neighbors[points]] - rays[:, None]  # (m, N, 3)
    outward, around = _tangents(rays)
    components = [np.einsum("mni,mi->mn", to_neighbors, tangent) for tangent in (outward, around)]
    steps = np.stack(_object_angles(built, points), axis=1) / plan.intersections  # (m, 2) [rad]
    vectors = np.stack(components, axis=2) / steps[:, None]  # (m, N, 2) [steps]
    length = np.linalg.norm(vectors, axis=2)
    following = np.roll(vectors, -1, axis=1)
    gap = np.linalg.norm(following - vectors, axis=2)
    cross = vectors[:, :, 0] * following[:, :, 1] - vectors[:, :, 1] * following[:, :, 0]
    angle = np.degrees(np.abs(np.arctan2(cross, (vectors * following).sum(axis=2))))
    return Links(*(Spread.of(each.ravel()) for each in (length, gap, angle)))


def _nearest_wall(built: BuiltMesh, distance: float) -> int:
    """The wall whose distance [m] has the ratio nearest to 1 to the distance of an object."""
    assert built.walls is not None
    first = np.flatnonzero(np.diff(built.walls, prepend=-1))
    return int(np.argmin(np.abs(built.distances[first] / distance - 1.0)))


def _tangents(rays: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (m, 3) at right angles to rays (m, 3): toward greater inclination, and around the vertical."""
    level = np.hypot(rays[:, 0], rays[:, 1])
    x = np.where(level > 1e-12, rays[:, 0] / np.maximum(level, 1e-12), 1.0)
    y = np.where(level > 1e-12, rays[:, 1] / np.maximum(level, 1e-12), 0.0)
    around = np.stack([-y, x, np.zeros(len(rays))], axis=1)
    outward = np.stack([-rays[:, 2] * x, -rays[:, 2] * y, level], axis=1)
    return outward, around


def _object_angles(built: BuiltMesh, points: np.ndarray) -> tuple[Floats, Floats]:
    """Angles (m,) [rad] that an object covers at the places of points (m,): in inclination, and across."""
    plan, shape = built.plan, built.plan.shape
    rays, distance = built.mesh.rays[points], built.distances[points]
    if built.walls is not None:
        assert isinstance(shape, Cylinder)
        low, high = np.arctan2(-plan.height, distance), np.arctan2(shape.object_height - plan.height, distance)
        # Above or below the horizon, the same azimuth is a smaller angle.
        level = np.hypot(rays[:, 0], rays[:, 1])
        return np.asarray(high - low), 2.0 * np.arcsin(shape.radius / distance) * level
    n = shape.n(np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), -rays[:, 2]), plan.height)
    inclination = np.asarray(shape.phi(n + 0.5, plan.height)) - np.asarray(shape.phi(n - 0.5, plan.height))
    away = np.hypot(distance, plan.height - shape.center_height)
    return inclination, 2.0 * np.arcsin(np.minimum(shape.radius / away, 1.0))
