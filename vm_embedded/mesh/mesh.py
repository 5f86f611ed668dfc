"""The Visual Mesh: a graph of rays that puts the same number of points on an object at every distance.

This file has the mesh itself, `Mesh`, and the base class of all ways to build one, `MeshModel`. The models by name are
in `models.py`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Indices, Mask, frozen, one_number
from ..errors import GeometryError
from ..geometry.shape import Shape

MOST_POINTS = 8_000_000
"""Largest number of points in a mesh: more than the pixels of a camera, and more than OpenCV samples at once."""


STRIDE = 1024
"""Rows from one strip of a mesh to the next: the cells of strip s are in the rows from STRIDE s."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """n points and their neighbors: a whole mesh or a part of one.

    rays: (n, 3) unit vectors from the camera, column by column in memory. They are in the mesh frame: that of the
        observation plane without the camera's yaw, so x is ahead of the camera and z up.
    neighbors: (n + 1, N) indices of points. Index n is the off-screen point, which takes the place of every missing
        neighbor. It is linked to itself.
    cells: (n, 2) column and row of each point on strips (mesh octaves); None for a mesh without strips.
    margin: (n,) which points only give context to the network and are no part of its answer; None for no point.
    """

    rays: Floats
    neighbors: Indices
    cells: Indices | None = None
    margin: Mask | None = None

    def __len__(self) -> int:
        return len(self.rays)

    @property
    def strips(self) -> Indices | None:
        """The strip (n,) of each point, in which all points stand for areas of the same size; None for a mesh without
        strips."""
        return None if self.cells is None else self.cells[:, 1] // np.int32(STRIDE)

    def needed(self, kept: Mask) -> Mask:
        """The points of a part `kept` (n,) that a network needs: not those of a strip of which it has only margin."""
        strips = self.strips
        if strips is None or self.margin is None:
            return kept
        return kept & (np.bincount(strips, kept & ~self.margin) > 0.0)[strips]

    @property
    def nbytes(self) -> int:
        """Size in memory [bytes]."""
        parts = (self.rays, self.neighbors, self.cells, self.margin)
        return sum(each.nbytes for each in parts if each is not None)

    def part(self, kept: npt.NDArray[np.intp]) -> Mesh:
        """The mesh of the points `kept` (m,), in that order. Links to other points lead to the off-screen point."""
        position = np.full(len(self) + 1, len(kept), dtype=np.int32)
        position[kept] = np.arange(len(kept), dtype=np.int32)
        rows = np.append(kept, len(self))
        rays = np.empty((len(kept), 3), order="F")
        np.take(self.rays.T, kept, axis=1, out=rays.T)
        neighbors = np.take(position, np.take(self.neighbors, rows, axis=0))
        cells = None if self.cells is None else frozen(np.take(self.cells, kept, axis=0))
        margin = None if self.margin is None else frozen(self.margin[kept])
        return Mesh(frozen(rays), frozen(neighbors), cells, margin)


class MeshModel(ABC):
    """A way to place points and to link them.

    neighbors: the number N of neighbors of a point. A network's weights depend on their order. steps: (columns, rows)
    to each neighbor if the points lie on a lattice, else None. mirrored: without steps, the neighbor (N,) that takes
    the place of each one in the mirror image.
    """

    neighbors: int
    steps: tuple[tuple[int, int], ...] | None = None
    mirrored: tuple[int, ...] = ()

    def build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh:
        """The mesh for objects of this shape, seen from a height [m], out to `max_distance` [m].

        intersections: rings of points across an object (the paper's k), and points of a ring across it.

        The paper requires height and radius, too (section "Visual Mesh Geometry").

        Raises GeometryError for a shape, a height, a number of intersections or a distance that this model cannot
        build, and InputError for what is not a number.
        """
        height, intersections = one_number(height, "height"), one_number(intersections, "intersections")
        max_distance = one_number(max_distance, "max_distance")
        if not (math.isfinite(intersections) and intersections > 0):
            raise GeometryError(f"intersections must be above 0, not {intersections}")
        if not (math.isfinite(max_distance) and max_distance > 0):
            raise GeometryError(f"maximum distance must be above 0 m, not {max_distance}")
        return self._build(shape, height, intersections, max_distance)

    @abstractmethod
    def _build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh: ...

    def mesh_height(self, shape: Shape, height: float, intersections: float, tolerance: float) -> float:
        """The height [m] to build the mesh for, so that it also serves other camera heights close to `height` [m].

        tolerance: how far [rings] the number of rings across an object may be from k; 0 gives `height` itself. This
        number is proportional to the shape's spacing. So mesh heights whose spacings form a geometric series with the
        ratio (1 + tolerance / k)^2 are close enough for every camera height.
        """
        spacing = float(shape.spacing(height))
        if tolerance == 0.0:
            return height
        step = 2.0 * math.log1p(tolerance / intersections)
        return shape.height_of(math.exp(step * round(math.log(spacing) / step)))

    def rings_across(
        self, made_for: Shape, mesh_height: float, intersections: float, seen: Shape, height: float
    ) -> float:
        """Number of rings that cross the object `seen` from a height [m].

        It is the same at every distance (paper: fig:mesh_projection). The rings belong to a mesh built for the shape
        `made_for`, `mesh_height` [m] and k = `intersections`.
        """
        return intersections * float(seen.spacing(height) / made_for.spacing(mesh_height))


def check_size(points: float) -> None:
    """Raises GeometryError for a mesh with too many points, before any memory is allocated."""
    if not points <= MOST_POINTS:
        number = f"{points:,.0f}" if points < 1e12 else "far too many"
        raise GeometryError(
            f"the mesh would have {number} points, and at most {MOST_POINTS:,} are allowed; choose fewer "
            "intersections, a smaller max_distance or a larger object_radius (with vm-export: --radius)"
        )


def rays_from_polar(inclination: Floats, angle: Floats) -> Floats:
    """Rays (n, 3) at an inclination (n,) [rad] from straight below and an angle (n,) [rad] around the vertical."""
    rays = np.empty((len(angle), 3), order="F")
    sine = np.sin(inclination)
    np.multiply(np.cos(angle), sine, out=rays[:, 0])
    np.multiply(np.sin(angle), sine, out=rays[:, 1])
    rays[:, 2] = -np.cos(inclination)
    return rays
