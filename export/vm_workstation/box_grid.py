"""Boxes in a grid by place and size, so that those at the place of another one are found without looking at all."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator

from vm_embedded.output.box_files import Edges

_CELLS = (0, -1, 1)
"""The own cell first: most boxes that are the same are in it."""


class BoxGrid:
    """Boxes with edges of one unit, by their class.

    least: the intersection over union, above 0, from which on boxes count as near each other. Widths of such boxes
    differ by a factor of 1 / least at most, and their left edges by 1 - least of the larger width; so do heights and
    upper edges. So the cells for larger boxes are larger, and only neighboring cells are searched.
    """

    def __init__(self, least: float) -> None:
        self._least = least
        self._factor = 1.01 / least  # of the widths in neighboring cells; the 0.01 allows for rounding
        self._cells: dict[tuple[str, int, int, int, int], list[tuple[int, Edges]]] = defaultdict(list)
        self._count = 0

    def add(self, name: str, edges: Edges) -> None:
        """Add a box of a class; its position is the number of those before it. A box without an area is near none."""
        sizes = self._sizes(edges)
        if sizes is not None:
            across, down = sizes
            cell = (name, across, down, self._place(edges[0], across), self._place(edges[1], down))
            self._cells[cell].append((self._count, edges))
        self._count += 1

    def near(self, name: str, edges: Edges) -> Iterator[tuple[int, Edges]]:
        """Positions and edges of all boxes of a class that are near a box, and of some others."""
        sizes = self._sizes(edges)
        if sizes is None:
            return
        columns, rows = (
            [(size + step, self._place(low, size + step)) for step in _CELLS]
            for low, size in zip(edges[:2], sizes, strict=True)
        )
        for across, column in columns:
            for down, row in rows:
                for x in _CELLS:
                    for y in _CELLS:
                        yield from self._cells.get((name, across, down, column + x, row + y), ())

    def _sizes(self, edges: Edges) -> tuple[int, int] | None:
        """The logarithms of width and height, rounded down; None for a box without an area."""
        width, height = edges[2] - edges[0], edges[3] - edges[1]
        if not (width > 0.0 and height > 0.0):
            return None
        scale = math.log(self._factor)
        return math.floor(math.log(width) / scale), math.floor(math.log(height) / scale)

    def _place(self, low: float, size: int) -> int:
        return math.floor(low / ((1.0 - self._least) * self._factor ** (size + 2)))
