"""The layout `lattice`: the points as pixels of a picture, for networks of ordinary convolutions without look-ups."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import Indices, Mask, Singles, frozen
from ..mesh.mesh import Mesh
from .layout import OFF_SCREEN, Feeds, WholeLayout, rays_in

BELOW = 3
"""Rows of gaps before the first point. The second slot of the second row has only gaps around it, so in every layer it
has the value of the off-screen point (vm_export/lattice_graph.py)."""


class LatticeLayout(WholeLayout):
    """The box around all cells of a lattice, row by row, with gaps around it.

    steps: columns and rows from a point to each of its neighbors. They replace the neighbor indices.
    """

    def __init__(self, mesh: Mesh, steps: tuple[tuple[int, int], ...]) -> None:
        assert mesh.cells is not None
        self._steps = steps
        column, row = (mesh.cells - mesh.cells.min(axis=0)).T if len(mesh) else np.zeros((2, 0), dtype=np.int32)
        width = int(column.max(initial=0)) + 3
        self._shape = int(row.max(initial=0)) + BELOW + 2, width
        places = (row + BELOW) * width + column + 1
        slots = np.full(self._shape[0] * width, len(mesh), dtype=np.int32)
        slots[places] = np.arange(len(mesh), dtype=np.int32)
        self.slots = frozen(slots)
        self.places = frozen(places.astype(np.int32))
        self.original = frozen(slots < len(mesh))
        self.rays = rays_in(mesh, slots)

    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        shifts = np.array([up * self._shape[1] + right for right, up in self._steps], dtype=np.int32)
        beside = np.asarray(members, dtype=np.int32)[:, None] + shifts
        return np.where(self.original[beside], beside, np.int32(len(self)))

    def feeds(self, colors: Singles, on_screen: Mask) -> Feeds:
        return {"points": np.where(on_screen, colors, OFF_SCREEN), "shown": on_screen.reshape(self._shape)}

    def probabilities(self, output: Singles) -> Singles:
        return output.T
