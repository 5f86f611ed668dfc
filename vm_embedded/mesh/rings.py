"""The paper's mesh: concentric rings around the point below the camera, with 4, 6 or 8 neighbors for each point.

The paper's section "Graph Structure of the Mesh" describes model ring6.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Indices, frozen
from ..geometry.shape import Shape
from .mesh import Mesh, MeshModel, check_size, rays_from_polar

_NEIGHBORS = {
    4: ("left", "top", "right", "bottom"),
    6: ("left", "top left", "top right", "right", "bottom right", "bottom left"),
    8: ("left", "top left", "top", "top right", "right", "bottom right", "bottom", "bottom left"),
}
"""Neighbors in their order. Left and right are in the same ring, top is in the next ring outwards, bottom inwards."""

# Subtracted before rounding up, so that float noise above a whole number does not add a point to a ring.
_CEIL_EPSILON = 1e-9


class Rings(MeshModel):
    """Ring i is at phi(i / k) and has ceil(2 pi k / theta(i / k)) points. Ring 0 is the nadir, a single point.

    With six neighbors these are the paper's rings (fig:mesh_projection).

    The order of the neighbors is that of the reference: left, then around the point by way of the top.
    """

    def __init__(self, neighbors: int) -> None:
        self.neighbors = neighbors
        names, sides = _NEIGHBORS[neighbors], {"left": "right", "right": "left"}
        swapped = (" ".join(sides.get(word, word) for word in name.split()) for name in names)
        self.mirrored = tuple(map(names.index, swapped))

    def _build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh:
        phi = inclinations(shape, height, intersections, max_distance)
        counts = ring_counts(shape, height, intersections, len(phi))
        start, place = ring_places(counts)
        rays = rays_from_polar(np.repeat(phi, counts), 2.0 * np.pi * place / np.repeat(counts, counts))
        return Mesh(frozen(rays), frozen(ring_neighbors(counts, start, place, self.neighbors)))


def inclinations(shape: Shape, height: float, intersections: float, max_distance: float) -> Floats:
    """The paper's phi_n (rings,) [rad] of all rings, the nadir first, with k = `intersections` rings across an object.

    The paper defines them for k = 1 (section "Visual Mesh Geometry", fig:geometry), and then for any k (section "Object
    Dependent Sample Density").

    The last ring is the last one closer than `max_distance` [m]. Raises GeometryError for a height that is too low for
    the shape, and for too many rings.
    """
    shape.spacing(height)  # raises GeometryError for a height that is too low
    rings_out = float(shape.n(math.atan(max_distance / height), height)) * intersections
    check_size(rings_out)
    # The last digit of `rings_out` may be too small, so take one more ring; the comparison below decides.
    phi = shape.phi(np.arange(1, math.floor(rings_out) + 2) / intersections, height)
    return np.append(0.0, phi[height * np.tan(phi) < max_distance])


def ring_counts(shape: Shape, height: float, intersections: float, rings: int) -> Indices:
    """Number of points in each ring (rings,). Points are the paper's Delta theta / k apart, or slightly less.

    fig:geometry and fig:circle_theta show Delta theta.
    """
    theta = shape.theta(np.arange(1, rings) / intersections, height)
    counts = np.ceil(2.0 * np.pi * intersections / theta - _CEIL_EPSILON)
    check_size(float(counts.sum()))
    return np.append(np.int32(1), counts.astype(np.int32))


def ring_places(counts: Indices) -> tuple[Indices, Indices]:
    """Where rings begin, and where points are in them.

    counts: (rings,) number of points in each ring. Returns two arrays. The first (rings + 1,) has
    the first point of each ring, then the number n of all points. The second (n,) has each point's place in its ring,
    from 0.
    """
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return start, np.arange(start[-1], dtype=np.int32) - np.repeat(start[:-1], counts)


class _RingsOfPoints(NamedTuple):
    """For each of n points one ring: its own, the next one inwards, or the next one outwards.

    first (n,): the ring's first point. size (n,): its number of points.
    """

    first: Indices
    size: Indices

    def at(self, place: Indices) -> Indices:
        """The points at these places (n,) in the rings. The place after a ring's last point is its first point."""
        return np.where(place == self.size, self.first, self.first + place)


def ring_neighbors(counts: Indices, start: Indices, place: Indices, width: int, nudge: float = 0.0) -> Indices:
    """Neighbors (n + 1, width) of points in rings (paper: section "Graph Structure of the Mesh").

    The last row, n, is that of the off-screen point, which is its own neighbor. counts: (rings,) number of points in
    each ring. start, place: from `ring_places`. width: 4, 6 or 8 neighbors. nudge: added to each place before its
    fraction of the circle is computed, so that float noise does not choose between two neighbors at the same distance.
    Only cap6 needs it: the sizes of its inner rings have a common divisor, so many of its points have two such
    neighbors.

    A point is linked to the two adjacent points of its ring, and to the points of the next rings at the same fraction
    of the circle. In each of these rings, width 6 links the nearest two, and width 4 only the nearest one. Width 8
    links the nearest two and, as top and bottom, the nearest one again. The nadir's neighbors are spread evenly over
    ring 1.
    """
    off_screen = int(start[-1])
    inner, own, outer = _beside(counts, start)
    # A float, as in the reference: integer arithmetic would round some places differently.
    fraction = (place + nudge) / own.size
    outwards, inwards = fraction * outer.size, fraction * inner.size
    outwards_floor, inwards_floor = outwards.astype(np.int32), inwards.astype(np.int32)

    find = {
        "left": lambda: own.at(np.where(place == 0, own.size, place) - 1),
        "right": lambda: own.at(place + 1),
        "top left": lambda: outer.at(outwards_floor),
        "top right": lambda: outer.at(outwards_floor + 1),
        "bottom left": lambda: inner.at(inwards_floor),
        "bottom right": lambda: inner.at(inwards_floor + 1),
        # Halves are rounded up, as C's round does for positive numbers.
        "top": lambda: outer.at(np.floor(outwards + 0.5).astype(np.int32)),
        "bottom": lambda: inner.at(np.floor(inwards + 0.5).astype(np.int32)),
    }
    neighbors = np.empty((off_screen + 1, width), dtype=np.int32)
    for column, name in enumerate(_NEIGHBORS[width]):
        neighbors[:off_screen, column] = find[name]()
    neighbors[off_screen] = off_screen
    neighbors[0] = off_screen
    if len(counts) > 1:  # the nadir's neighbors, spread over ring 1, whose first point is 1
        neighbors[0] = 1 + (np.arange(width) * counts[1]) // width
    return neighbors


def _beside(counts: Indices, start: Indices) -> tuple[_RingsOfPoints, _RingsOfPoints, _RingsOfPoints]:
    """For each point, the next ring inwards, its own ring and the next ring outwards.

    Beyond the last ring is a ring with only the off-screen point. The nadir's inner ring is never used.
    """
    # `start` already ends with n. So the ring beyond the last one begins at the off-screen point, and its size is 1.
    counts_around, start_around = np.pad(counts, 1, constant_values=1), np.pad(start, (1, 0))

    def shifted_by(step: int) -> _RingsOfPoints:
        shifted = slice(step, step + len(counts))
        return _RingsOfPoints(np.repeat(start_around[shifted], counts), np.repeat(counts_around[shifted], counts))

    return shifted_by(0), shifted_by(1), shifted_by(2)
