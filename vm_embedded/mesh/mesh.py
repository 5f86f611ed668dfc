"""The Visual Mesh: a graph of rays that puts the same number of points on an object at every distance."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Indices, frozen
from ..errors import GeometryError
from ..geometry.shape import Shape

SELF = -1
"""The point itself, where others are named by their position among its neighbors."""

Runs = tuple[tuple[int, ...], ...]
"""Neighbors that follow each other in memory, in groups of at most three; together all of a point's neighbors."""


MOST_POINTS = 8_000_000
"""Of a mesh: more than OpenCV samples at once, and more than a camera has pixels."""


class PointGraph(Protocol):
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
    cells: (n, 2) column and row of each point in a lattice where all neighbors are fixed steps away, or None.
    """

    rays: Floats
    neighbors: Indices
    cells: Indices | None = None

    def __len__(self) -> int:
        return len(self.rays)

    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        """Neighbors (m, N) of some points (m,)."""
        return np.take(self.neighbors, members, axis=0)

    @property
    def nbytes(self) -> int:
        """Memory that it holds [bytes]."""
        return self.rays.nbytes + self.neighbors.nbytes + (0 if self.cells is None else self.cells.nbytes)

    def part(self, kept: npt.NDArray[np.intp]) -> Mesh:
        """The mesh of the points `kept`, in that order; links to all others lead to the off-screen point."""
        position = np.full(len(self) + 1, len(kept), dtype=np.int32)
        position[kept] = np.arange(len(kept), dtype=np.int32)
        rows = np.append(kept, len(self))
        rays = np.empty((len(kept), 3), order="F")
        np.take(self.rays.T, kept, axis=1, out=rays.T)
        neighbors = np.take(position, np.take(self.neighbors, rows, axis=0))
        cells = None if self.cells is None else frozen(np.take(self.cells, kept, axis=0))
        return Mesh(frozen(rays), frozen(neighbors), cells)


class MeshModel(ABC):
    """A way to place points and to link them.

    neighbors: N of each point; their order fixes the meaning of a network's weights. runs: those that follow each other
    in memory. steps: columns and rows to each neighbor, in a model whose points lie on a lattice, else None.
    """

    neighbors: int
    runs: Runs
    steps: tuple[tuple[int, int], ...] | None = None

    def build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh:
        """The mesh for objects of a shape, seen from a height [m], out to `max_distance` [m].

        `intersections` k is the number of points in a row across an object. Raises GeometryError for a shape, height,
        intersections or distance that have no mesh.
        """
        if not (math.isfinite(intersections) and intersections > 0):
            raise GeometryError(f"intersections must be above 0, not {intersections}")
        if not (math.isfinite(max_distance) and max_distance > 0):
            raise GeometryError(f"maximum distance must be above 0 m, not {max_distance}")
        return self._build(shape, height, intersections, max_distance)

    @abstractmethod
    def _build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh: ...

    def mesh_height(self, shape: Shape, height: float, intersections: float, tolerance: float) -> float:
        """Height [m] of the mesh that serves a camera height [m], such that no row is off by more than `tolerance`.

        The number of rings across an object is proportional to the shape's spacing, so heights whose spacings form a
        geometric series with ratio (1 + t / k)^2 leave no height farther than t rings from its mesh.
        """
        spacing = float(shape.spacing(height))
        if tolerance == 0.0:
            return height
        step = 2.0 * math.log1p(tolerance / intersections)
        return shape.height_of(math.exp(step * round(math.log(spacing) / step)))

    def rings(self, made_for: Shape, mesh_height: float, intersections: float, seen: Shape, height: float) -> float:
        """Rings that cross the object `seen` from a height [m], of a mesh that was made for others."""
        return intersections * float(seen.spacing(height) / made_for.spacing(mesh_height))


def check_size(points: float) -> None:
    """Raise GeometryError for more points than a mesh may have, before they take memory."""
    if not points <= MOST_POINTS:
        raise GeometryError(
            f"a mesh of {points:.3g} points is too large, {MOST_POINTS:g} are allowed: take fewer intersections, a "
            "shorter maximum distance or a larger object"
        )


def polar(inclination: Floats, angle: Floats) -> Floats:
    """Rays (n, 3) at an inclination (n,) [rad] from straight below and an angle (n,) [rad] around the vertical."""
    rays = np.empty((len(angle), 3), order="F")
    sine = np.sin(inclination)
    np.multiply(np.cos(angle), sine, out=rays[:, 0])
    np.multiply(np.sin(angle), sine, out=rays[:, 1])
    rays[:, 2] = -np.cos(inclination)
    return rays
