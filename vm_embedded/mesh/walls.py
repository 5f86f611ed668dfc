"""Model wall6: a mesh for upright cylinders of any height. A goal post higher than the camera has k points across, too.

Rings need the far end of an object's shadow on the plane. The shadow of an object as high as the camera has no end, and
all rings would fall on the horizon. The paper names this limit in its section "Discussion and Conclusion".

So this model samples an object on its own surface. Cylindrical walls stand around the camera, at distances in a
geometric series. Each wall carries k rows of points from the plane to the object's top, and each row has k points
across an object. A direction may lie on several walls. On the wall at its own distance an object covers all rows, from
the first to the last. On other walls it has the wrong width or ends in the wrong row.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Floats, Indices, frozen
from ..errors import GeometryError
from ..geometry.shape import Shape
from ..geometry.shapes import Cylinder
from .grids import STEPS, row_groups
from .mesh import Mesh, MeshModel, check_size, rays_from_polar

NEAREST = 0.3
"""Distance of the nearest objects that the first wall is for [m]."""


class Walls(MeshModel):
    """Walls around the camera, the nearest first; in each wall row by row, the lowest row first.

    The six neighbors have the order of a lattice's, `STEPS`. Walls are not linked to each other.
    """

    neighbors = 6
    groups = row_groups(STEPS[neighbors])

    def _build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh:
        tall = _checked(shape, height).object_height
        rows = round(intersections)
        distances = wall_distances(shape, intersections, max_distance)
        counts = wall_counts(shape, intersections, max_distance)
        up = (np.arange(rows) + 0.5) / rows * tall - height  # height of the rows above the camera [m]

        off_screen = rows * int(counts.sum())
        neighbors = np.full((off_screen + 1, self.neighbors), off_screen, dtype=np.int32)
        rays, first = [], 0
        for distance, count in zip(distances.tolist(), counts.tolist(), strict=True):
            row, place = (axis.reshape(-1) for axis in np.mgrid[:rows, :count].astype(np.int32))
            rays.append(rays_from_polar(np.arctan2(distance, -up[row]), 2.0 * np.pi * (place + 0.5 * row) / count))
            wall = slice(first, first + len(row))
            for column, (right, above) in enumerate(STEPS[self.neighbors]):
                to_row, to_place = row + above, (place + right) % count
                there = (to_row >= 0) & (to_row < rows)
                neighbors[wall, column] = np.where(there, first + to_row * count + to_place, off_screen)
            first = wall.stop
        return Mesh(frozen(np.asfortranarray(np.concatenate(rays))), frozen(neighbors))

    def mesh_height(self, shape: Shape, height: float, intersections: float, tolerance: float) -> float:
        """The mesh height [m] from an arithmetic series: rows are object_height / k apart and move with the camera."""
        step = 2.0 * tolerance * _checked(shape, height).object_height / intersections
        return height if step == 0.0 else max(round(height / step) * step, 0.5 * step)

    def rings_across(
        self, made_for: Shape, mesh_height: float, intersections: float, seen: Shape, height: float
    ) -> float:
        """Always k, because an object is sampled where it stands."""
        return intersections


def _checked(shape: Shape, height: float) -> Cylinder:
    """The shape, if it is a cylinder. Raises GeometryError for other shapes and for a height [m] of 0 or less."""
    if not isinstance(shape, Cylinder):
        raise GeometryError(
            f"mesh model wall6 is for cylinders, not for a {type(shape).__name__.lower()}; use ring6 or cap6"
        )
    if not (math.isfinite(height) and height > 0):
        raise GeometryError(f"camera height must be above 0 m, not {height} m")
    return shape


def wall_distances(shape: Shape, intersections: float, max_distance: float) -> Floats:
    """Distances (m,) of the walls [m], the nearest first.

    An object at the distance d fills the angle 2 a(d) = 2 asin(r / d), and k a(d) / a(w) points of the wall at w. A
    wall is for objects with a(d) from 1 - 1 / k to 1 + 1 / k times a(w), which have k - 1 to k + 1 points. The next
    wall begins where it ends. Rounding a row up to whole points makes objects wider by up to a(d) / pi points, so the
    upper end is lower by that much.

    Raises GeometryError for fewer than 2 intersections, and for a radius or a maximum distance that leaves no room for
    a wall at NEAREST.
    """
    if intersections < 2.0:
        raise GeometryError(f"mesh model wall6 needs at least 2 intersections, not {intersections:g}")
    if max_distance <= NEAREST:
        raise GeometryError(
            f"walls begin at {NEAREST:g} m, so the maximum distance must be above that, not {max_distance:g} m"
        )
    if shape.radius >= NEAREST:
        raise GeometryError(f"walls begin at {NEAREST:g} m, so the radius must be below that, not {shape.radius:g} m")
    widest, narrowest = (math.asin(shape.radius / each) for each in (NEAREST, max_distance))
    low, high = 1.0 - 1.0 / intersections, 1.0 + (1.0 - widest / math.pi) / intersections
    with np.errstate(divide="ignore", over="ignore"):
        walls = np.ceil(np.log(np.float64(widest) / narrowest) / np.log(high / low))
    check_size(float(walls))
    borders = np.geomspace(widest, narrowest, int(walls) + 1)
    return np.asarray(shape.radius / np.sin(np.sqrt(borders[:-1] / high * borders[1:] / low)))


def wall_counts(shape: Shape, intersections: float, max_distance: float) -> Indices:
    """Points in a row of each wall (m,). Raises GeometryError like `wall_distances`, and for too many points."""
    theta = 2.0 * np.arcsin(shape.radius / wall_distances(shape, intersections, max_distance))
    counts = np.ceil(2.0 * np.pi * intersections / theta - 1e-9)
    check_size(float(counts.sum()) * intersections)
    return counts.astype(np.int32)
