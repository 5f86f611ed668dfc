"""How a network takes a mesh: in which order its points, and by which indices their neighbors.

A layout is prepared once for a mesh. Each frame then only says which points are on screen: links to all others lead to
the off-screen point. All layouts give the same answers; the manifest names the one that a model file was written for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Indices, Mask, Singles, frozen
from ..mesh.mesh import Mesh

Feeds = dict[str, npt.NDArray[np.generic]]
"""A network's inputs by name."""

OFF_SCREEN = np.float32(-1.0)
"""Color of the off-screen point."""


class Layout(ABC):
    """A mesh of n points in a network's order.

    slots: the point of each of its m slots, or n in gaps. places: the slot of each point (n,). original: which slots
    (m,) these are; all others are gaps or copies of points. rays: (m, 3), NaN in gaps.

    As a graph (mesh.Graph) it consists of its slots; nothing is linked to gaps and copies.
    """

    slots: Indices
    places: Indices
    original: Mask
    rays: Floats

    def __len__(self) -> int:
        return len(self.slots)

    @abstractmethod
    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        """Neighbors (k, N) of originals (k,), as slots; m is the off-screen point."""

    @property
    def nbytes(self) -> int:
        """Memory that it holds [bytes]."""
        return self.slots.nbytes + self.places.nbytes + self.original.nbytes + self.rays.nbytes

    @abstractmethod
    def points(self) -> Singles:
        """An array for the network's input `points`."""

    @abstractmethod
    def colors(self, points: Singles) -> Singles:
        """Where in such an array the colors (m, 3) of the slots go."""

    @abstractmethod
    def feeds(self, points: Singles, on_screen: Mask) -> Feeds:
        """The network's inputs from the colored `points` and the slots (m,) that are on screen."""

    @abstractmethod
    def answers(self, output: Singles) -> Singles:
        """Probabilities (m, C) of the slots from the network's output; without meaning off screen."""


class PlainLayout(Layout):
    """Points as rows and a row of neighbors for each; the off-screen point is the last row."""

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

    def points(self) -> Singles:
        return np.empty((len(self) + 1, 3), dtype=np.float32)

    def colors(self, points: Singles) -> Singles:
        return points[:-1]

    def feeds(self, points: Singles, on_screen: Mask) -> Feeds:
        points[-1] = OFF_SCREEN
        neighbors, missing = self._neighbors, np.int32(len(self))
        shown = np.append(on_screen, False)[neighbors]
        instead = np.arange(missing + 1, dtype=np.int32)[:, None] if self._edge == "same" else missing
        return {"points": points, "neighbors": np.where(shown, neighbors, instead)}

    def answers(self, output: Singles) -> Singles:
        return output[:-1]
