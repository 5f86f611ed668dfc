"""The layout `canvas`: the strips of a mesh side by side on one picture, for networks of ordinary convolutions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import Chosen, Indices, Mask, Singles, frozen
from ..mesh.mesh import STRIDE, Mesh
from ..mesh.octaves import BLOCK, GAP
from .layout import Feeds, Layout, rays_in

SMALLEST = 2 * BLOCK
"""Rows and columns of the smallest canvas: networks halve it three times, and training needs several cells then."""


@dataclass(frozen=True)
class Piece:
    """Where a strip is on a canvas: its first row and column there, and the numbers of its rows and columns."""

    row: int
    column: int
    rows: int
    columns: int

    @property
    def region(self) -> tuple[slice, slice]:
        """Its rows and columns of the canvas."""
        return slice(self.row, self.row + self.rows), slice(self.column, self.column + self.columns)


class CanvasLayout(Layout):
    """The boxes around the points of each strip, upright, with gaps between them.

    shape: rows and columns of the canvas, multiples of BLOCK. pieces: the boxes of the strips. Points in the margin of
    the mesh have slots, but no places; a strip of such points only is left out.
    """

    def __init__(self, mesh: Mesh, steps: tuple[tuple[int, int], ...]) -> None:
        assert mesh.cells is not None
        self._steps = steps
        core = np.ones(len(mesh), dtype=bool) if mesh.margin is None else ~mesh.margin
        self.pieces, self.shape, slot = place_on_canvas(mesh.cells, core)
        slots = np.full(self.shape[0] * self.shape[1], len(mesh), dtype=np.int32)
        placed = np.flatnonzero(slot >= 0).astype(np.int32)
        slots[slot[placed]] = placed
        self.slots = frozen(slots)
        self.places = frozen(slot[core])
        original = np.zeros(len(slots), dtype=bool)
        original[self.places] = True
        self.original = frozen(original)
        self.rays = rays_in(mesh, slots)
        self.strips = frozen(np.append(mesh.cells[:, 1] // np.int32(STRIDE), np.int32(-1))[slots])

    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        rows, columns = self.shape
        row, column = np.divmod(np.asarray(members, dtype=np.int32)[:, None], np.int32(columns))
        right, up = np.array(self._steps, dtype=np.int32).T
        row, column = row - up, column + right
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        beside = np.where(inside, row * columns + column, 0)
        return np.where(inside & self.original[beside], beside, np.int32(len(self)))

    def feeds(self, colors: Singles, on_screen: Mask) -> Feeds:
        points = np.where(on_screen, colors, np.float32(0.0))
        return {"points": points.reshape(1, 3, *self.shape), "shown": on_screen.reshape(1, 1, *self.shape)}

    def probabilities(self, output: Singles) -> Singles:
        return output.reshape(-1, len(self)).T


def place_on_canvas(cells: Indices, core: Mask) -> tuple[tuple[Piece, ...], tuple[int, int], Indices]:
    """The pieces of a canvas for points with these cells (n, 2), its rows and columns, and the slot (n,) of each point.

    core (n,): which points are no margin; points of a strip without any have the slot -1. The rows of a canvas count
    downwards, those of the cells upwards.
    """
    strips = list(_boxes(cells, core))
    places, shape = pack([(high[1] - low[1] + 1, high[0] - low[0] + 1) for _, low, high in strips])
    slot = np.full(len(cells), -1, dtype=np.int32)
    pieces = []
    for (members, low, high), (row, column) in zip(strips, places, strict=True):
        across, up = (cells[members] - low).T
        slot[members] = (row + high[1] - low[1] - up) * shape[1] + column + across
        pieces.append(Piece(row, column, high[1] - low[1] + 1, high[0] - low[0] + 1))
    return tuple(pieces), shape, frozen(slot)


def _boxes(cells: Indices, core: Mask) -> Iterator[tuple[Chosen, tuple[int, int], tuple[int, int]]]:
    """The points of each strip with core points, and the lowest and highest column and row of a box for their cells.

    Left and top of a box are whole blocks away from those of the whole strip, so that a network halves the same cells
    together whatever part of the strip is in view.
    """
    strip = cells[:, 1] // STRIDE
    for number in np.flatnonzero(np.bincount(strip[core])).tolist():
        members = np.flatnonzero(strip == number)
        low, high = cells[members].min(axis=0).tolist(), cells[members].max(axis=0).tolist()
        first, top = low[0] - low[0] % BLOCK, high[1] + (BLOCK - GAP - 1 - high[1]) % BLOCK
        yield members, (first, low[1]), (high[0], top)


def pack(sizes: Sequence[tuple[int, int]]) -> tuple[list[tuple[int, int]], tuple[int, int]]:
    """Places of boxes on a small canvas: row and column of each, and rows and columns of the canvas.

    sizes: rows and columns of the boxes. The boxes stand on shelves, the tallest first, each on the first shelf with
    room; of several widths of the canvas, the one with the smallest area is taken. All places are multiples of BLOCK,
    and at least GAP cells are between two boxes.
    """
    widest = max([SMALLEST, *(columns for _, columns in sizes)])
    widths = range(_blocks(widest), 2 * _blocks(widest) + BLOCK, BLOCK)
    return min((_on_shelves(sizes, width) for width in widths), key=lambda found: found[1][0] * found[1][1])


def _on_shelves(sizes: Sequence[tuple[int, int]], width: int) -> tuple[list[tuple[int, int]], tuple[int, int]]:
    """Places of boxes on a canvas of this width, and its rows and columns. See `pack`."""
    places = [(0, 0)] * len(sizes)
    shelves: list[list[int]] = []  # row, rows, and first free column of each
    end = 0
    for number in sorted(range(len(sizes)), key=lambda each: (-sizes[each][0], -sizes[each][1])):
        rows, columns = sizes[number]
        shelf = next((each for each in shelves if each[2] + columns <= width), None)
        if shelf is None:
            shelf = [end, rows, 0]
            shelves.append(shelf)
            end += _blocks(rows + GAP)
        places[number] = shelf[0], shelf[2]
        shelf[2] += _blocks(columns + GAP)
    bottom = max([SMALLEST, *(row + rows for (row, _), (rows, _) in zip(places, sizes, strict=True))])
    return places, (_blocks(bottom), width)


def _blocks(cells: int) -> int:
    """Cells of whole blocks that hold so many cells."""
    return -(-cells // BLOCK) * BLOCK
