"""Meshes of concentric rings around the point below the camera, with 4, 6 or 8 neighbors: the paper's."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Floats, Indices, frozen
from ..geometry.shape import Shape
from .mesh import SELF, Mesh, MeshModel, check_size, polar

_RUNS = {
    4: ((0, SELF, 2), (1,), (3,)),
    6: ((0, SELF, 3), (1, 2), (5, 4)),
    8: ((0, SELF, 4), (1, 3), (2,), (7, 5), (6,)),
}

# Float noise must not change the size of a ring; no real count comes this close to a whole number from above.
_CEIL_EPSILON = 1e-9


class Rings(MeshModel):
    """Ring i lies at phi(i / k) and has ceil(2 pi k / theta) points. Ring 0 is the nadir.

    Neighbors of ring4: left, top, right, bottom; ring6: left, top-left, top-right, right, bottom-right, bottom-left;
    ring8: left, top-left, top, top-right, right, bottom-right, bottom, bottom-left, where top is the next ring
    outwards.
    """

    def __init__(self, neighbors: int) -> None:
        self.neighbors = neighbors
        self.runs = _RUNS[neighbors]

    def _build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh:
        phi = inclinations(shape, height, intersections, max_distance)
        counts = ring_counts(shape, height, intersections, len(phi))
        start, j = places(counts)
        rays = polar(np.repeat(phi, counts), 2.0 * np.pi * j / np.repeat(counts, counts))
        return Mesh(frozen(rays), frozen(ring_neighbors(counts, start, j, self.neighbors)))


def inclinations(shape: Shape, height: float, intersections: float, max_distance: float) -> Floats:
    """phi (rings,) [rad] of each ring, the nadir first. Raises GeometryError for a height without a mesh."""
    shape.spacing(height)
    last = float(shape.n(math.atan(max_distance / height), height)) * intersections
    check_size(last)
    # One ring more than the closed form gives, since its last digit may fall short; the rule itself decides.
    phi = shape.phi(np.arange(1, math.floor(last) + 2) / intersections, height)
    return np.append(0.0, phi[height * np.tan(phi) < max_distance])


def ring_counts(shape: Shape, height: float, intersections: float, rings: int) -> Indices:
    """How many points each of so many rings has (rings,)."""
    theta = shape.theta(np.arange(1, rings) / intersections, height)
    counts = np.ceil(2.0 * np.pi * intersections / theta - _CEIL_EPSILON)
    check_size(float(counts.sum()))
    return np.append(np.int32(1), counts.astype(np.int32))


def places(counts: Indices) -> tuple[Indices, Indices]:
    """Where rings of `counts` points (rings,) begin (rings + 1,), and each point's place in its ring (n,)."""
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return start, np.arange(start[-1], dtype=np.int32) - np.repeat(start[:-1], counts)


def ring_neighbors(counts: Indices, start: Indices, j: Indices, width: int, nudge: float = 0.0) -> Indices:
    """Neighbors (n + 1, width) in rings of `counts` points (rings,), which begin at `start` (rings + 1,).

    j (n,) is each point's place in its ring. nudge: of places that are compared between rings, so that float noise does
    not decide where one ring's size is a multiple of another's.
    """
    missing = int(start[-1])

    def of_rings(values: Indices) -> Indices:
        """A value of each ring, for each of its points."""
        return np.repeat(values, counts)

    def around(first: Indices, size: Indices, index: Indices) -> Indices:
        """Points at a place in a ring; the place after its last is its first."""
        return np.where(index == size, first, first + index)

    padded_counts, padded_start = np.pad(counts, 1, constant_values=1), np.pad(start, (1, 0))
    inner, own, outer = (
        (of_rings(padded_start[at : at + len(counts)]), of_rings(padded_counts[at : at + len(counts)]))
        for at in range(3)
    )
    fraction = (j + nudge) / own[1]  # and not whole numbers, because that is what the reference rounds
    out_position, in_position = fraction * outer[1], fraction * inner[1]
    out_floor, in_floor = out_position.astype(np.int32), in_position.astype(np.int32)

    neighbors = np.empty((missing + 1, width), dtype=np.int32)
    left = around(*own, np.where(j == 0, own[1], j) - 1)
    right = around(*own, j + 1)
    if width in (4, 8):  # halves are rounded upwards, as C's round does for these positive numbers
        top = around(*outer, np.floor(out_position + 0.5).astype(np.int32))
        bottom = around(*inner, np.floor(in_position + 0.5).astype(np.int32))
    if width in (6, 8):
        top_left, top_right = around(*outer, out_floor), around(*outer, out_floor + 1)
        bottom_left, bottom_right = around(*inner, in_floor), around(*inner, in_floor + 1)
    columns: list[Indices]
    if width == 4:
        columns, outwards = [left, top, right, bottom], [1]
    elif width == 6:
        columns, outwards = [left, top_left, top_right, right, bottom_right, bottom_left], [1, 2]
    else:
        columns = [left, top_left, top, top_right, right, bottom_right, bottom, bottom_left]
        outwards = [1, 2, 3]
    for column, points in enumerate(columns):
        neighbors[:missing, column] = points
    neighbors[start[-2] : missing, outwards] = missing
    # The nadir's neighbors are spread evenly over ring 1.
    neighbors[0] = 1 + (np.arange(width) * counts[1]) // width if len(counts) > 1 else missing
    neighbors[missing] = missing
    return neighbors
