"""Meshes on a lattice: every neighbor is a fixed step away, and there are no rings to close.

They are those of the authors' implementation, the reference (docs/reference-networks.md).

The camera is at the height h over the plane and the object's center at the height c; g = h - c. phi(n, h) is the
inclination n objects out, seen from the height h (`Shape.phi`). The points have coordinates x and y at the height c.

Take a line at the height c, parallel to an axis, at the distance d from the vertical through the camera. The plane
through the line and the camera is a *slice*. In the slice, the camera is slant = sqrt(g^2 + d^2) away from the line.
Below the camera, d is 0 and slant is g. Any other line looks, in its slice, like one below a camera that is slant
above it: at the height slant + c over the plane. So the point of the line that is n objects out has

    coordinate(n, d) = slant tan(phi(n, slant + c)).

A lattice counts objects, u along x and v along y, in steps of 1 / k. In the reference's names, X and Y are coordinates
in the slice with d = 0, straight below the camera. N and M are coordinates in the slice with d = the other coordinate:

- XY: x = coordinate(u, 0) and y = coordinate(v, 0);
- XM: x = coordinate(u, 0) and y = coordinate(v, x);
- NM: x = coordinate(u, y) and y = coordinate(v, x), two equations that are solved together.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays import Chosen, Floats, Indices, Mask, frozen
from ..geometry.shape import Shape
from .mesh import Mesh, MeshModel, check_size

STEPS = {
    4: ((-1, 0), (0, 1), (1, 0), (0, -1)),
    6: ((-1, 0), (-1, 1), (0, 1), (1, 0), (1, -1), (0, -1)),
    8: ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)),
}
"""(columns, rows) to each neighbor, by the number of neighbors. Clockwise, with rows drawn upwards."""

_ROW = math.sqrt(0.75)
"""Distance between the rows of a six-neighbor lattice [steps]."""

_TURNS, _HALVINGS, _SETTLED = 30, 60, 1e-12
"""For NM's equations: the most iterations of `_solve_in_turns`, the iterations of `_solve_by_halving` for points that
do not settle (as with thin cylinders), and the relative change at which a point has settled."""

KINDS = ("xy", "xm", "nm")

_Coordinate = Callable[[Floats, Floats | float], Floats]
"""coordinate(n, d) of p points [m]. n (p,): how many objects out they are. d: distance (p,) [m], or one number."""


class Grid(MeshModel):
    """A lattice of one of KINDS, row by row. It keeps only the points that a path of links connects to the nadir.

    A point has a column and a row, and its neighbors are `steps` away. With four or eight neighbors u = column / k and
    v = row / k. With six neighbors each row is shifted by half a step, and rows are closer than columns:
    u = (column + row / 2) / k and v = sqrt(3) / 2 row / k. In the code, half counts half steps along a row: 2 column,
    or 2 column + row with six neighbors.
    """

    steps: tuple[tuple[int, int], ...]

    def __init__(self, kind: str, neighbors: int) -> None:
        self.kind = kind
        self.neighbors = neighbors
        self.steps = STEPS[neighbors]

    def _build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh:
        shape.spacing(height)  # raises GeometryError for a height without a mesh
        x, y = self._quarter(shape, height, intersections, max_distance)
        last_row, last_half = (size - 1 for size in x.shape)
        row, half = (each.astype(np.int32) for each in np.mgrid[-last_row : last_row + 1, -last_half : last_half + 1])
        exists = np.isfinite(x[np.abs(row), np.abs(half)])
        row, half = row[exists], half[exists]
        column = (half - row) // 2 if self.neighbors == 6 else half // 2
        linked = _connected_to_nadir(column, row, self.neighbors)
        row, column, half = row[linked], column[linked], half[linked]

        rays = np.empty((len(column), 3), order="F")
        rays[:, 0] = np.sign(half) * x[np.abs(row), np.abs(half)]
        rays[:, 1] = np.sign(row) * y[np.abs(row), np.abs(half)]
        rays[:, 2] = shape.center_height - height
        rays /= np.sqrt(rays[:, 0] ** 2 + rays[:, 1] ** 2 + rays[:, 2] ** 2)[:, None]
        cells = np.stack([column - column.min(), row - row.min()], axis=1)
        return Mesh(frozen(rays), frozen(lattice_neighbors(cells, self.steps)))

    def _quarter(self, shape: Shape, height: float, intersections: float, max_distance: float) -> tuple[Floats, Floats]:
        """x and y [m] in the quarter of the lattice with x >= 0 and y >= 0; the other quarters are its mirror images.

        Both are (rows, half steps). x is NaN where the lattice has no point; y then has no meaning. Raises
        GeometryError for too many points.
        """
        six = self.neighbors == 6
        row_step = _ROW if six else 1.0
        border = _border(self.kind, shape, height, max_distance) * intersections  # [steps]
        u_most, v_most = border.max(axis=0).tolist()
        check_size(u_most * v_most)
        # Rows and half steps are tried from 0 to one beyond the border.
        rows = math.floor(v_most / row_step) + 2
        halves = math.floor(u_most / 0.5) + 2
        row, half = (axis.reshape(-1) for axis in np.mgrid[:rows, :halves].astype(np.int32))
        steps = np.stack([0.5 * half, row_step * row], axis=1)
        # Points are where the column is whole: half = 2 column, or 2 column + row with six neighbors.
        tried = np.flatnonzero(((half - row if six else half) % 2 == 0) & _within(steps, border))
        u, v = (steps[tried] / intersections).T
        x, y = _positions(self.kind, u, v, shape, height)
        x[np.hypot(x, y) > max_distance] = np.nan
        found = np.full((2, rows * halves), np.nan)
        found[:, tried] = x, y
        return found[0].reshape(rows, halves), found[1].reshape(rows, halves)


def _coordinate(shape: Shape, height: float) -> _Coordinate:
    """coordinate(n, d) of this module's docstring, for a shape seen from a height [m]."""
    c = shape.center_height
    g = height - c

    def coordinate(n: Floats, distance: Floats | float) -> Floats:
        slant = np.hypot(g, distance)
        return np.asarray(slant * np.tan(shape.phi(n, slant + c)))

    return coordinate


def _positions(kind: str, u: Floats, v: Floats, shape: Shape, height: float) -> tuple[Floats, Floats]:
    """Coordinates x and y (n,) [m] at the height of the object's center, u and v (n,) >= 0 objects out."""
    coordinate = _coordinate(shape, height)
    x = coordinate(u, 0.0)
    if kind == "xy":
        return x, coordinate(v, 0.0)
    y = coordinate(v, x)
    if kind == "xm":
        return x, y
    x, y, unsettled = _solve_in_turns(coordinate, u, v, x, y, height - shape.center_height)
    if len(unsettled):
        x[unsettled], y[unsettled] = _solve_by_halving(coordinate, u[unsettled], v[unsettled])
    return x, y


def _solve_in_turns(
    coordinate: _Coordinate, u: Floats, v: Floats, first_x: Floats, first_y: Floats, g: float
) -> tuple[Floats, Floats, Chosen]:
    """x and y (n,) of NM: computes each from the other until both settle, from first values (n,) on.

    A coordinate far out hardly depends on its slice, so nearly all points settle in about ten turns. Also returns the
    indices of the points that still move by more than _SETTLED (g + x + y) after _TURNS turns.
    """
    x, y = first_x.copy(), first_y.copy()
    moving = np.arange(len(u))
    for _ in range(_TURNS):
        new_x = coordinate(u[moving], y[moving])
        new_y = coordinate(v[moving], new_x)
        change = np.maximum(np.abs(new_x - x[moving]), np.abs(new_y - y[moving]))
        x[moving], y[moving] = new_x, new_y
        moving = moving[change > _SETTLED * (g + new_x + new_y)]
    return x, y, moving


def _solve_by_halving(coordinate: _Coordinate, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """x and y (n,) of NM, by halving the interval that holds x. Slow, but it always settles.

    A coordinate shrinks as its slice moves away. So x is between 0 and its value in the slice below the camera.
    """
    low, high = np.zeros(len(u)), coordinate(u, 0.0)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        # F(x) = coordinate(u, coordinate(v, x)) is larger than x if x is below the solution, smaller if x is above it.
        too_large = coordinate(u, coordinate(v, middle)) < middle
        low, high = np.where(too_large, low, middle), np.where(too_large, middle, high)
    x = 0.5 * (low + high)
    return x, coordinate(v, x)


def _border(kind: str, shape: Shape, height: float, max_distance: float) -> Floats:
    """u and v (m, 2) of points on the border of the quarter: a quarter circle with the radius `max_distance` [m]."""
    c = shape.center_height
    angle = np.linspace(0.0, np.pi / 2.0, 721)
    x, y = max_distance * np.cos(angle), max_distance * np.sin(angle)

    def objects_out(place: Floats, distance: Floats | float) -> Floats:
        """How many objects out `place` is in the slice at `distance`; inverse of `_Coordinate`."""
        slant = np.hypot(height - c, distance)
        return np.asarray(shape.n(np.arctan2(place, slant), slant + c))

    u = objects_out(x, y if kind == "nm" else 0.0)
    v = objects_out(y, 0.0 if kind == "xy" else x)
    return np.stack([u, v], axis=1)


def _within(points: Floats, border: Floats) -> Mask:
    """Which points (n, 2) of a quarter lie within its border (m, 2) or up to two steps beyond it; both are in steps.

    This filter is coarse. It only saves `_positions` from computing most points outside; `_quarter` then drops every
    point beyond max_distance. The border runs from the first axis to the second. It is drawn as a polygon, and each
    point looks up its pixel. No point may lie more than one step beyond the largest u and v of the border, because
    there the drawing ends.
    """
    width, height = (math.ceil(each) + 3 for each in border.max(axis=0))
    outline = np.concatenate([[[0.0, 0.0]], border])
    inside = np.zeros((height, width), dtype=np.uint8)
    cv2.fillPoly(inside, [np.rint(outline).astype(np.int32)], 1)
    inside = cv2.dilate(inside, np.ones((5, 5), dtype=np.uint8))
    nearest = np.rint(points).astype(np.intp)
    return np.asarray(inside[nearest[:, 1], nearest[:, 0]] > 0)


def _connected_to_nadir(column: Indices, row: Indices, neighbors: int) -> Mask:
    """Which cells in columns (m,) and rows (m,) are connected to the cell (0, 0) by links to 4, 6 or 8 neighbors.

    The cells become pixels, and OpenCV finds their connected components.
    """
    # With six neighbors, pixels are half columns, so neighbors in other rows touch at corners.
    x, y = 2 * column + row if neighbors == 6 else column, row
    x, y = x - x.min(), y - y.min()
    present = np.zeros((y.max() + 1, x.max() + 1), dtype=np.uint8)
    present[y, x] = 1
    if neighbors == 6:  # neighbors in a row are two pixels apart, so the pixel between them is set, too
        present[:, 1:-1] |= present[:, :-2] & present[:, 2:]
    _, label = cv2.connectedComponents(present, connectivity=4 if neighbors == 4 else 8)
    labels = label[y, x]
    return np.asarray(labels == labels[(column == 0) & (row == 0)])


def lattice_neighbors(cells: Indices, steps: tuple[tuple[int, int], ...]) -> Indices:
    """Neighbors (n + 1, N) of cells (n, 2) at fixed steps (N, 2), each as (columns, rows)."""
    off_screen = len(cells)
    width, height = cells.max(axis=0) + 3  # with an empty cell all around, so that no step leaves the table
    flat = (cells[:, 1] + 1) * width + cells[:, 0] + 1
    index = np.full(width * height, off_screen, dtype=np.int32)
    index[flat] = np.arange(off_screen, dtype=np.int32)
    neighbors: npt.NDArray[np.int32] = np.empty((off_screen + 1, len(steps)), dtype=np.int32)
    for number, (right, up) in enumerate(steps):
        neighbors[:off_screen, number] = index[flat + up * width + right]
    neighbors[off_screen] = off_screen
    return neighbors
