"""The base class of layouts: a mesh in the order that a network takes it.

A layout is prepared once for a mesh. For each frame it only needs to know which points are on screen. It turns the
links to all other points into links to the off-screen point. All layouts give the same probabilities. The manifest
names the layout that a model file was written for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Indices, Mask, Singles

Feeds = dict[str, npt.NDArray[np.generic]]
"""A network's inputs by name."""

Run = Callable[[Feeds], Singles]
"""A network: from its inputs to its output."""

OFF_SCREEN = np.float32(-1.0)
"""Color of the off-screen point."""


class Layout(ABC):
    """The n points of a mesh, laid out in m slots.

    A slot holds a point, a copy of a point, or nothing; an empty slot is a gap. Used as a mesh.PointGraph,
    its points are the slots. All links lead to original points, never to copies.

    slots: (m,) point of each slot; n in gaps. places: (n,) slot of each point. original: (m,) True for the slots in
    `places`, False for gaps and copies. rays: (m, 3) of the slots' points, NaN in gaps.
    """

    slots: Indices
    places: Indices
    original: Mask
    rays: Floats

    def __len__(self) -> int:
        return len(self.slots)

    @abstractmethod
    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        """The slots (k, N) of the neighbors of the points in k original slots; m is the off-screen point."""

    @property
    def nbytes(self) -> int:
        """Size in memory [bytes]."""
        return self.slots.nbytes + self.places.nbytes + self.original.nbytes + self.rays.nbytes

    @abstractmethod
    def new_points(self) -> Singles:
        """A new array for the network's input `points`; write the colors into its view `colors_of`."""

    @abstractmethod
    def colors_of(self, points: Singles) -> Singles:
        """View (m, 3) of the slots' colors in an array of `new_points`."""

    @abstractmethod
    def answers(self, network: Run, points: Singles, on_screen: Mask) -> Singles:
        """Probabilities (m, C) of the slots, valid only on screen.

        points: the colored array; it may be changed. on_screen: mask (m,) of the slots.
        """


class WholeLayout(Layout):
    """A layout that the network takes in one call."""

    def answers(self, network: Run, points: Singles, on_screen: Mask) -> Singles:
        return self.probabilities(network(self.feeds(points, on_screen)))

    @abstractmethod
    def feeds(self, points: Singles, on_screen: Mask) -> Feeds:
        """The network's inputs; see `answers`. Fills in the off-screen point's color, OFF_SCREEN, in place."""

    @abstractmethod
    def probabilities(self, output: Singles) -> Singles:
        """Probabilities (m, C) of the slots from the network's output."""
