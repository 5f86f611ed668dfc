"""A mesh for upright cylinders of any height: as many points on a goal post as high as the camera, near and far.

Rings need the end of an object's shadow on the plane, and what reaches the camera's height has none: all rings would
fall on the horizon. So an object is sampled where it stands, on its own surface. Walls around the camera, at distances
that form a geometric series, carry k rows of points from the plane to the object's top, and k points across the object
in each row. A direction may lie on several walls. On the wall at its own distance an object covers all rows from the
first to the last, and on the others it has the wrong width or ends in the wrong row.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Floats, Indices, frozen
from ..errors import GeometryError
from ..geometry.cylinder import Cylinder
from ..geometry.shape import Shape
from .grids import Grid
from .mesh import Mesh, MeshModel, check_size, polar

NEAREST = 0.3
"""Distance [m] at which the first wall begins to serve."""


class Walls(MeshModel):
    """Walls around the camera, the nearest first, each from its lowest row to its highest.

    Neighbors as those of a six-neighbor lattice: left, top-left, top-right, right, bottom-right, bottom-left.
    """

    neighbors = 6
    runs = Grid("xy", 6).runs

    def _build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh:
        tall = _checked(shape, height).object_height
        rows = round(intersections)
        distances = wall_distances(shape, intersections, max_distance)
        counts = wall_counts(shape, intersections, max_distance)
        up = (np.arange(rows) + 0.5) / rows * tall - height  # over the camera [m]

        pieces, links, first = [], [], 0
        for distance, count in zip(distances.tolist(), counts.tolist(), strict=True):
            row, place = (axis.reshape(-1) for axis in np.mgrid[:rows, :count].astype(np.int32))
            pieces.append(polar(np.arctan2(distance, -up[row]), 2.0 * np.pi * (place + 0.5 * row) / count))
            links.append((row, place, count, first))
            first += rows * count
        neighbors = np.full((first + 1, self.neighbors), first, dtype=np.int32)
        for row, place, count, start in links:
            for column, (right, above) in enumerate(Grid("xy", 6).steps):
                to_row, to_place = row + above, (place + right) % count
                there = (to_row >= 0) & (to_row < rows)
                neighbors[start : start + len(row), column] = np.where(there, start + to_row * count + to_place, first)
        return Mesh(frozen(np.asfortranarray(np.concatenate(pieces))), frozen(neighbors))

    def mesh_height(self, shape: Shape, height: float, intersections: float, tolerance: float) -> float:
        """Rows are object_height / k apart, and move by as much as the camera."""
        step = 2.0 * tolerance * _checked(shape, height).object_height / intersections
        return height if step == 0.0 else max(round(height / step) * step, 0.5 * step)

    def rings(self, made_for: Shape, mesh_height: float, intersections: float, seen: Shape, height: float) -> float:
        """Always k: objects are sampled where they stand."""
        return intersections


def _checked(shape: Shape, height: float) -> Cylinder:
    """The shape as the cylinder that it is. Raises GeometryError for other shapes, and for what is no camera height."""
    if not isinstance(shape, Cylinder):
        raise GeometryError(f"walls are for cylinders, not for a {type(shape).__name__.lower()}")
    if not (math.isfinite(height) and height > 0):
        raise GeometryError(f"camera height must be above 0 m, not {height} m")
    return shape


def wall_distances(shape: Shape, intersections: float, max_distance: float) -> Floats:
    """Distances (m,) of walls [m], from the nearest to the farthest.

    An object at d fills the angle 2 a(d) = 2 asin(r / d), and k a(d) / a(w) points of the wall at w. So a wall serves
    angles from 1 - 1 / k to 1 + 1 / k of its own, and the next one begins where it ends. A row is rounded up to whole
    points, which makes objects wider by up to a(d) / pi points; the upper end leaves room for that.

    Raises GeometryError for fewer than 2 intersections, an object too thick for the first wall, or if all is nearer.
    """
    if intersections < 2.0:
        raise GeometryError(f"walls need at least 2 intersections, not {intersections:g}")
    if max_distance <= NEAREST:
        raise GeometryError(f"walls begin at {NEAREST:g} m; a maximum distance of {max_distance:g} m leaves none")
    if shape.radius >= NEAREST:
        raise GeometryError(f"walls begin at {NEAREST:g} m, so a cylinder of {shape.radius:g} m radius has no room")
    widest, narrowest = (math.asin(shape.radius / each) for each in (NEAREST, max_distance))
    low, high = 1.0 - 1.0 / intersections, 1.0 + (1.0 - widest / math.pi) / intersections
    with np.errstate(divide="ignore", over="ignore"):
        walls = np.ceil(np.log(np.float64(widest) / narrowest) / np.log(high / low))
    check_size(float(walls))
    borders = np.geomspace(widest, narrowest, int(walls) + 1)
    return np.asarray(shape.radius / np.sin(np.sqrt(borders[:-1] / high * borders[1:] / low)))


def wall_counts(shape: Shape, intersections: float, max_distance: float) -> Indices:
    """How many points a row of each wall has (m,). Raises GeometryError as wall_distances does."""
    theta = 2.0 * np.arcsin(shape.radius / wall_distances(shape, intersections, max_distance))
    counts = np.ceil(2.0 * np.pi * intersections / theta - 1e-9)
    check_size(float(counts.sum()) * intersections)
    return counts.astype(np.int32)
