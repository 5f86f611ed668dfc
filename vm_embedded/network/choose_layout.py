"""The choice between the layouts, and layout plain: points as rows, and a row of neighbors for each."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import Indices, Mask, Singles, frozen
from ..mesh.mesh import Mesh
from .canvas_layout import CanvasLayout
from .layout import OFF_SCREEN, Feeds, WholeLayout
from .manifest import Manifest
from .runs_layout import RunsLayout


def choose_layout(mesh: Mesh, manifest: Manifest) -> WholeLayout:
    """The mesh in the layout that the manifest's network takes."""
    if manifest.layout == "runs":
        return RunsLayout(mesh, manifest.model.groups)
    if manifest.layout == "canvas":
        assert manifest.model.steps is not None  # Manifest accepts this layout only for strips.
        return CanvasLayout(mesh, manifest.model.steps)
    return PlainLayout(mesh, manifest.edge)


class PlainLayout(WholeLayout):
    """Slot i is point i, without gaps or copies. The off-screen point is the last row of every input.

    edge: the policy for a neighbor that is off screen. Policy "hard" puts the off-screen point in its place, "same" the
    point itself.
    """

    def __init__(self, mesh: Mesh, edge: str) -> None:
        self.slots = self.places = frozen(np.arange(len(mesh), dtype=np.int32))
        self.original = frozen(np.ones(len(mesh), dtype=bool))
        self.rays = mesh.rays
        self._neighbors = mesh.neighbors
        self._edge = edge

    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        return np.take(self._neighbors, members, axis=0)

    @property
    def nbytes(self) -> int:
        return super().nbytes + self._neighbors.nbytes

    def feeds(self, colors: Singles, on_screen: Mask) -> Feeds:
        points = np.full((len(self) + 1, 3), OFF_SCREEN)
        points[:-1] = colors.T
        neighbors, missing = self._neighbors, np.int32(len(self))
        shown = np.append(on_screen, False)[neighbors]
        instead = np.arange(missing + 1, dtype=np.int32)[:, None] if self._edge == "same" else missing
        return {"points": points, "neighbors": np.where(shown, neighbors, instead)}

    def probabilities(self, output: Singles) -> Singles:
        return output[:-1]
