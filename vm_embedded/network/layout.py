"""The base class of layouts: a mesh in the order that a network takes it.

A layout is prepared once for a mesh. For each frame it only needs to know which points are on screen. It turns the
links to all other points into links to the off-screen point.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Indices, Mask, Singles, frozen
from ..mesh.mesh import Mesh

Feeds = dict[str, npt.NDArray[np.generic]]
"""A network's inputs by name."""

Run = Callable[[Feeds], Singles]
"""A network: from its inputs to its output."""

OFF_SCREEN = np.float32(-1.0)
"""Color of the off-screen point."""


class Layout(ABC):
    """The n points of a mesh, laid out in m slots.

    A slot holds a point or nothing; an empty slot is a gap. Used as a mesh.PointGraph, its points are the slots.

    slots: (m,) point of each slot; n in gaps. places: (n,) slot of each point. original: (m,) True for the slots in
    `places`, False for gaps and points of the mesh's margin. rays: (m, 3) of the slots' points, NaN in gaps. strips:
    (m,) strip of each slot, -1 in gaps; None for a mesh without strips.
    """

    slots: Indices
    places: Indices
    original: Mask
    rays: Floats
    strips: Indices | None = None

    def __len__(self) -> int:
        return len(self.slots)

    @abstractmethod
    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        """The slots (k, N) of the neighbors of the points in k original slots; m is the off-screen point."""

    @property
    def nbytes(self) -> int:
        """Size in memory [bytes]."""
        strips = 0 if self.strips is None else self.strips.nbytes
        return self.slots.nbytes + self.places.nbytes + self.original.nbytes + self.rays.nbytes + strips

    def answers(self, network: Run, colors: Singles, on_screen: Mask) -> Singles:
        """All outputs (m, outputs) for the slots, valid only on screen.

        colors (3, m): of the slots, as the network takes them. on_screen (m,): which slots are on screen.
        """
        return self.probabilities(network(self.feeds(colors, on_screen)))

    @abstractmethod
    def feeds(self, colors: Singles, on_screen: Mask) -> Feeds:
        """The network's inputs, with the color OFF_SCREEN where it needs the off-screen point; see `answers`."""

    @abstractmethod
    def probabilities(self, output: Singles) -> Singles:
        """Probabilities (m, C) of the slots from the network's output."""


def rays_in(mesh: Mesh, slots: npt.NDArray[np.integer]) -> Floats:
    """Rays (m, 3) of the points in slots (m,), column by column in memory; NaN in gaps."""
    return frozen(np.take(np.append(mesh.rays.T, np.full((3, 1), np.nan), axis=1), slots, axis=1)).T
