"""The layout `canvas`: the strips of a mesh side by side on one picture, for networks of ordinary convolutions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Chosen, Indices, Mask, Singles, frozen
from ..mesh.mesh import STRIDE, Mesh
from ..mesh.octaves import BLOCK, GAP
from .layout import Feeds, Layout

SMALLEST = 2 * BLOCK
"""Rows and columns of the smallest canvas: networks halve it three times, and training needs several cells then."""


@dataclass(frozen=True)
class Piece:
    """Where a strip is on a canvas: its first row and column there, and the numbers of its rows and columns.

    point: the first point of the mesh on it.
    """

    row: int
    column: int
    rows: int
    columns: int
    point: int

    @property
    def region(self) -> tuple[slice, slice]:
        """Its rows and columns of the canvas."""
        return slice(self.row, self.row + self.rows), slice(self.column, self.column + self.columns)


class CanvasLayout(Layout):
    """The boxes around the points of each strip, upright, with gaps between them.

    shape: rows and columns of the canvas, multiples of BLOCK. pieces: the boxes of the strips.
    """

    def __init__(self, mesh: Mesh) -> None:
        assert mesh.cells is not None
        self.pieces, self.shape, self._places = place_on_canvas(mesh.cells)
        self.nbytes = self._places.nbytes

    def spread(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        found = np.zeros(self.shape[0] * self.shape[1], dtype=values.dtype)
        found[self._places] = values
        return found

    def feeds(self, colors: Singles, on_screen: Mask) -> Feeds:
        shown = self.spread(on_screen)
        points = np.where(shown, colors, np.float32(0.0))
        return {"points": points.reshape(1, 3, *self.shape), "shown": shown.reshape(1, 1, *self.shape)}

    def read(self, output: Singles, points: Chosen) -> Singles:
        return np.take(output.reshape(output.shape[1], -1), self._places[points], axis=1).T


def place_on_canvas(cells: Indices) -> tuple[tuple[Piece, ...], tuple[int, int], Chosen]:
    """The pieces of a canvas for points with these cells (n, 2), its rows and columns, and the places (n,) of these.

    A place is row * columns + column. The rows of a canvas count downwards, those of the cells upwards.
    """
    strips = list(_boxes(cells))
    corners, shape = pack([(high[1] - low[1] + 1, high[0] - low[0] + 1) for _, low, high in strips])
    places = np.empty(len(cells), dtype=np.intp)
    pieces = []
    for (members, low, high), (row, column) in zip(strips, corners, strict=True):
        across, up = (cells[members] - low).T
        places[members] = (row + high[1] - low[1] - up) * shape[1] + column + across
        pieces.append(Piece(row, column, high[1] - low[1] + 1, high[0] - low[0] + 1, int(members[0])))
    return tuple(pieces), shape, frozen(places)


def _boxes(cells: Indices) -> Iterator[tuple[Chosen, tuple[int, int], tuple[int, int]]]:
    """The points of each strip, and the lowest and highest column and row of a box for their cells.

    Left and top of a box are whole blocks away from those of the whole strip, so that a network halves the same cells
    together whatever part of the strip is in view.
    """
    strip = cells[:, 1] // STRIDE
    for number in np.flatnonzero(np.bincount(strip)).tolist():
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
