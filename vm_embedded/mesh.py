"""The Visual Mesh: a graph of rays that puts the same number of points on an object at every distance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from .arrays import Floats, Indices, frozen
from .errors import GeometryError, InputError, unknown
from .shapes import Shape

RING_NEIGHBORS = {"ring4": 4, "ring6": 6, "ring8": 8}
"""Neighbors of a point in each mesh model."""

SELF = -1
"""The point itself, where others are named by their position among its neighbors."""

RUNS: dict[str, tuple[tuple[int, ...], ...]] = {
    "ring4": ((0, SELF, 2), (1,), (3,)),
    "ring6": ((0, SELF, 3), (1, 2), (5, 4)),
    "ring8": ((0, SELF, 4), (1, 3), (2,), (7, 5), (6,)),
}
"""Neighbors that follow each other in their ring, in groups of at most three; together all of a point's neighbors."""

# Float noise must not change the size of a ring; no real count comes this close to a whole number from above.
_CEIL_EPSILON = 1e-9


class Graph(Protocol):
    """n points that are linked."""

    @property
    def rays(self) -> Floats:
        """Unit vectors (n, 3) in the observation-plane frame, from the camera."""

    def __len__(self) -> int: ...

    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        """Neighbors (m, N) of some points (m,); n is the off-screen point."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """n points and their neighbors, or any part of such a mesh.

    rays: (n, 3) unit vectors in the observation-plane frame, from the camera, column by column in memory.
    neighbors: (n + 1, N) positions in the mesh. Row n is the one off-screen point, which stands for every missing
        neighbor and is linked to itself.
    """

    rays: Floats
    neighbors: Indices

    def __len__(self) -> int:
        return len(self.rays)

    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        """Neighbors (m, N) of some points (m,)."""
        return np.take(self.neighbors, members, axis=0)

    @property
    def nbytes(self) -> int:
        """Memory that it holds [bytes]."""
        return self.rays.nbytes + self.neighbors.nbytes

    def part(self, kept: npt.NDArray[np.intp]) -> Mesh:
        """The mesh of the points `kept`, in that order; links to all others lead to the off-screen point."""
        position = np.full(len(self) + 1, len(kept), dtype=np.int32)
        position[kept] = np.arange(len(kept), dtype=np.int32)
        rows = np.append(kept, len(self))
        rays = np.empty((len(kept), 3), order="F")
        np.take(self.rays.T, kept, axis=1, out=rays.T)
        return Mesh(frozen(rays), frozen(np.take(position, np.take(self.neighbors, rows, axis=0))))


def ring_mesh(shape: Shape, height: float, intersections: float, max_distance: float, model: str = "ring6") -> Mesh:
    """Concentric rings around the point below the camera, out to `max_distance` [m] on the plane.

    Ring i lies at phi(i / k) and has ceil(2 pi k / theta) points; `intersections` k is the number of rings that
    cross an object. Ring 0 is the nadir. The order of the neighbors fixes the meaning of a network's weights:
    ring4 left, top, right, bottom; ring6 left, top-left, top-right, right, bottom-right, bottom-left; ring8 left,
    top-left, top, top-right, right, bottom-right, bottom, bottom-left, where top is the next ring outwards.

    Raises GeometryError for a height, intersections or distance that have no mesh, InputError for an unknown model.
    """
    if model not in RING_NEIGHBORS:
        raise InputError(unknown("mesh model", model, RING_NEIGHBORS))
    if not (math.isfinite(intersections) and intersections > 0):
        raise GeometryError(f"intersections must be above 0, not {intersections}")
    if not (math.isfinite(max_distance) and max_distance > 0):
        raise GeometryError(f"maximum distance must be above 0 m, not {max_distance}")

    shape.spacing(height)  # raises GeometryError for a height without a mesh
    last = float(shape.n(math.atan(max_distance / height), height)) * intersections
    # One ring more than the closed form gives, since its last digit may fall short; the rule itself decides.
    i = np.arange(1, math.floor(last) + 2)
    phi = shape.phi(i / intersections, height)
    phi = phi[height * np.tan(phi) < max_distance]
    theta = shape.theta(i[: len(phi)] / intersections, height)
    counts = np.ceil(2.0 * np.pi * intersections / theta - _CEIL_EPSILON).astype(np.int32)
    counts = np.concatenate([np.ones(1, dtype=np.int32), counts])
    phi = np.concatenate([[0.0], phi])

    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    j = np.arange(start[-1], dtype=np.int32) - np.repeat(start[:-1], counts)
    angle = 2.0 * np.pi * j / np.repeat(counts, counts)
    sine = np.repeat(np.sin(phi), counts)
    rays = np.empty((len(j), 3), order="F")
    np.multiply(np.cos(angle), sine, out=rays[:, 0])
    np.multiply(np.sin(angle), sine, out=rays[:, 1])
    rays[:, 2] = np.repeat(-np.cos(phi), counts)
    return Mesh(frozen(rays), frozen(_ring_neighbors(counts, start, j, RING_NEIGHBORS[model])))


def _ring_neighbors(counts: Indices, start: Indices, j: Indices, width: int) -> Indices:
    """Neighbor table (n + 1, width) of rings of `counts` points from `start` on; j is a point's place in its ring."""
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
    fraction = j / own[1]  # and not whole numbers, because that is what the reference rounds
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
