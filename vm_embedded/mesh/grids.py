"""Meshes on a lattice: every neighbor is a fixed step away, and there is no ring to close.

A lattice counts objects along two axes of the plane, u and v, in steps of 1 / k. With c the height of the object's
center and g = h - c, a point of the plane at the height c has the coordinates
XY: x = g tan(phi(u)), y = g tan(phi(v));
XM: x = g tan(phi(u)), y = h' tan(phi(v, h' + c)) with h' = sqrt(g^2 + x^2): the slice through the camera that holds y;
NM: both at once, x = h'' tan(phi(u, h'' + c)) with h'' = sqrt(g^2 + y^2), and y as in XM.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Indices, Mask, frozen
from ..geometry.shape import Shape
from .mesh import SELF, Mesh, MeshModel, check_size

_STEPS = {
    4: ((-1, 0), (0, 1), (1, 0), (0, -1)),
    6: ((-1, 0), (-1, 1), (0, 1), (1, 0), (1, -1), (0, -1)),
    8: ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)),
}
_RUNS = {
    4: ((0, SELF, 2), (1,), (3,)),
    6: ((0, SELF, 3), (1, 2), (5, 4)),
    8: ((0, SELF, 4), (1, 2, 3), (7, 6, 5)),
}
_ROW = math.sqrt(0.75)
"""Distance of the rows of a six-neighbor lattice, in steps."""

_TURNS, _HALVINGS = 30, 60
"""How often an NM point's coordinates are computed from each other in turns, about ten are needed; where that does not
settle, as for thin cylinders, how often the interval of one is halved."""

KINDS = ("xy", "xm", "nm")


class Grid(MeshModel):
    """A lattice of one of KINDS, row by row, as far as it hangs together with the point below the camera.

    Neighbors, as columns and rows: `steps`. A six-neighbor lattice has axial coordinates: u = (n + m / 2) / k and
    v = sqrt(3) / 2 m / k.
    """

    steps: tuple[tuple[int, int], ...]

    def __init__(self, kind: str, neighbors: int) -> None:
        self.kind = kind
        self.neighbors = neighbors
        self.runs = _RUNS[neighbors]
        self.steps = _STEPS[neighbors]

    def _build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh:
        shape.spacing(height)  # raises GeometryError for a height without a mesh
        x, y = self._quarter(shape, height, intersections, max_distance)
        rows, halves = (size - 1 for size in x.shape)
        m, half = (axis.astype(np.int32) for axis in np.mgrid[-rows : rows + 1, -halves : halves + 1])
        shown = np.isfinite(x[np.abs(m), np.abs(half)])
        m, half = m[shown], half[shown]
        n = (half - m) // 2 if self.neighbors == 6 else half // 2
        linked = _together(n, m, self.neighbors)
        m, n, half = m[linked], n[linked], half[linked]

        rays = np.empty((len(n), 3), order="F")
        rays[:, 0] = np.sign(half) * x[np.abs(m), np.abs(half)]
        rays[:, 1] = np.sign(m) * y[np.abs(m), np.abs(half)]
        rays[:, 2] = shape.center_height - height
        rays /= np.sqrt(rays[:, 0] ** 2 + rays[:, 1] ** 2 + rays[:, 2] ** 2)[:, None]
        cells = np.stack([n - n.min(), m - m.min()], axis=1)
        return Mesh(frozen(rays), frozen(lattice_neighbors(cells, self.steps)), frozen(cells))

    def _quarter(self, shape: Shape, height: float, intersections: float, max_distance: float) -> tuple[Floats, Floats]:
        """x and y [m] of the quarter of the lattice that both are positive in, and all others are mirror images of.

        (rows, half columns); NaN where no point is. Raises GeometryError for more places than memory has.
        """
        six = self.neighbors == 6
        row = _ROW if six else 1.0
        border = _border(self.kind, shape, height, max_distance) * intersections
        across, along = border.max(axis=0).tolist()
        check_size(across * along)
        halves, rows = (math.floor(each) + 2 for each in border.max(axis=0) * (2.0, 1.0 / row))
        m, half = (axis.reshape(-1) for axis in np.mgrid[:rows, :halves].astype(np.int32))
        places = np.stack([0.5 * half, row * m], axis=1)
        tried = np.flatnonzero(((half - m if six else half) % 2 == 0) & _within(places, border))
        u, v = (places[tried] / intersections).T
        x, y = _position(self.kind, u, v, shape, height)
        x[np.hypot(x, y) > max_distance] = np.nan
        found = np.full((2, rows * halves), np.nan)
        found[:, tried] = x, y
        return found[0].reshape(rows, halves), found[1].reshape(rows, halves)


def _position(kind: str, u: Floats, v: Floats, shape: Shape, height: float) -> tuple[Floats, Floats]:
    """Coordinates x and y (n,) [m] at the height of the object's center, u and v (n,) >= 0 objects out."""
    c = shape.center_height
    g = height - c

    def across(n: Floats, other: Floats | float) -> Floats:
        """Coordinate n objects out, in the slice through the camera that is `other` [m] away."""
        slant = np.hypot(g, other)
        return np.asarray(slant * np.tan(shape.phi(n, slant + c)))

    x = across(u, 0.0)
    if kind == "xy":
        return x, across(v, 0.0)
    y = across(v, x)
    if kind == "xm":
        return x, y
    # A slice's coordinate hardly depends on the slice where it is far out itself, so turns settle nearly everywhere.
    left = np.arange(len(u))
    for _ in range(_TURNS):
        new_x = across(u[left], y[left])
        new_y = across(v[left], new_x)
        off = np.maximum(np.abs(new_x - x[left]), np.abs(new_y - y[left])) > 1e-12 * (g + new_x + new_y)
        x[left], y[left] = new_x, new_y
        left = left[off]
    # A coordinate shrinks as its slice moves away, so x lies between 0 and that of the slice below the camera.
    low, high = np.zeros(len(left)), across(u[left], 0.0)
    for _ in range(_HALVINGS if len(left) else 0):
        middle = 0.5 * (low + high)
        beyond = across(u[left], across(v[left], middle)) < middle
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    x[left] = 0.5 * (low + high)
    y[left] = across(v[left], x[left])
    return x, y


def _border(kind: str, shape: Shape, height: float, max_distance: float) -> Floats:
    """Points (m, 2) of a quarter circle of that radius [m] around the camera's foot, as u and v."""
    c = shape.center_height
    angle = np.linspace(0.0, np.pi / 2.0, 721)
    x, y = max_distance * np.cos(angle), max_distance * np.sin(angle)

    def counted(along: Floats, other: Floats | float) -> Floats:
        slant = np.hypot(height - c, other)
        return np.asarray(shape.n(np.arctan2(along, slant), slant + c))

    u = counted(x, y if kind == "nm" else 0.0)
    v = counted(y, 0.0 if kind == "xy" else x)
    return np.stack([u, v], axis=1)


def _within(places: Floats, border: Floats) -> Mask:
    """Which places (n, 2) lie within a border (m, 2) from the first axis to the second, or up to two steps beyond."""
    width, height = (math.ceil(each) + 3 for each in border.max(axis=0))
    outline = np.concatenate([[[0.0, 0.0]], border, [[0.0, border[-1, 1]]]])
    inside = np.zeros((height, width), dtype=np.uint8)
    cv2.fillPoly(inside, [np.rint(outline).astype(np.int32)], 1)
    inside = cv2.dilate(inside, np.ones((5, 5), dtype=np.uint8))
    nearest = np.minimum(np.rint(places).astype(np.intp), (width - 1, height - 1))
    return np.asarray(inside[nearest[:, 1], nearest[:, 0]] > 0)


def _together(n: Indices, m: Indices, neighbors: int) -> Mask:
    """Which of the cells in columns n and rows m hang together with the cell (0, 0), by links to so many neighbors."""
    row = m - m.min()
    if neighbors == 6:
        # In half columns neighbors in other rows touch at corners; those in a row touch what is put between them.
        column = 2 * n + m
        column = column - column.min()
        present = np.zeros((row.max() + 1, column.max() + 3), dtype=np.uint8)
        present[row, column] = 1
        present[:, 1:-1] |= present[:, :-2] & present[:, 2:]
    else:
        column = n - n.min()
        present = np.zeros((row.max() + 1, column.max() + 1), dtype=np.uint8)
        present[row, column] = 1
    _, label = cv2.connectedComponents(present, connectivity=4 if neighbors == 4 else 8)
    labels = label[row, column]
    return np.asarray(labels == labels[(n == 0) & (m == 0)])


def lattice_neighbors(cells: Indices, steps: tuple[tuple[int, int], ...]) -> Indices:
    """Neighbors (n + 1, N) of cells (n, 2) at fixed steps (N, 2)."""
    missing = len(cells)
    width, height = cells.max(axis=0) + 3
    flat = (cells[:, 1] + 1) * width + cells[:, 0] + 1
    index = np.full(width * height, missing, dtype=np.int32)
    index[flat] = np.arange(missing, dtype=np.int32)
    neighbors: npt.NDArray[np.int32] = np.empty((missing + 1, len(steps)), dtype=np.int32)
    for column, (right, up) in enumerate(steps):
        neighbors[:missing, column] = index[flat + up * width + right]
    neighbors[missing] = missing
    return neighbors
