"""The base class of layouts: how a network takes the points of a mesh.

A layout is prepared once for a mesh. For each frame it only needs to know which points are on screen. It turns the
links to all other points into links to the off-screen point. Only a layout knows the places of a network's input: its
answers are in the order of the mesh.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Chosen, Mask, Singles

Feeds = dict[str, npt.NDArray[np.generic]]
"""A network's inputs by name."""

OFF_SCREEN = np.float32(-1.0)
"""Color of the off-screen point."""


class Layout(ABC):
    """The n points of a mesh in the m places of a network's input; a place holds a point or nothing."""

    nbytes: int
    """Size in memory [bytes], without the mesh."""

    @abstractmethod
    def spread(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The values (n,) of points in their places (m,), and 0 in places without one."""

    @abstractmethod
    def feeds(self, colors: Singles, on_screen: Mask) -> Feeds:
        """The network's inputs, with the color OFF_SCREEN where it needs the off-screen point.

        colors (3, m): of the places. on_screen (n,): which points of the mesh are on screen.
        """

    @abstractmethod
    def read(self, output: Singles, points: Chosen) -> Singles:
        """The answers (k, outputs) to points (k,) in the network's output."""
