"""The choice between the layouts, and layout plain: points as rows, and a row of neighbors for each."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Chosen, Mask, Singles
from ..mesh.mesh import Mesh
from .canvas_layout import CanvasLayout
from .layout import OFF_SCREEN, Feeds, Layout
from .manifest import Manifest


def choose_layout(mesh: Mesh, manifest: Manifest) -> Layout:
    """The mesh in the layout that the manifest's network takes."""
    if manifest.on_canvas:
        return CanvasLayout(mesh)
    return PlainLayout(mesh, manifest.edge)


class PlainLayout(Layout):
    """Place i holds point i. The off-screen point is the last row of every input.

    edge: the policy for a neighbor that is off screen. Policy "hard" puts the off-screen point in its place, "same" the
    point itself.
    """

    def __init__(self, mesh: Mesh, edge: str) -> None:
        self.nbytes = 0
        self._neighbors = mesh.neighbors
        self._edge = edge

    def spread(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        return values

    def feeds(self, colors: Singles, on_screen: Mask) -> Feeds:
        neighbors, missing = self._neighbors, np.int32(len(on_screen))
        points = np.full((len(neighbors), 3), OFF_SCREEN)
        points[:-1] = colors.T
        shown = np.append(on_screen, False)[neighbors]
        instead = np.arange(missing + 1, dtype=np.int32)[:, None] if self._edge == "same" else missing
        return {"points": points, "neighbors": np.where(shown, neighbors, instead)}

    def read(self, output: Singles, points: Chosen) -> Singles:
        return np.take(output, points, axis=0)
