"""Places in a picture to look at."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..arrays import Chosen, Floats, Image, Mask, Singles
from ..network.look_contract import LookContract
from .observation import Observation
from .patches import Tangents, cut_patches, patch_nodes
from .prepared_view import PreparedView

_NEAR = 0.3
"""Places within this share of an object's radius around its center were meant to be its center."""


class Places(Protocol):
    """Places in a picture to look at."""

    def __len__(self) -> int: ...

    def cut(self, rows: Chosen, contract: LookContract) -> Image:
        """Patches (k, size, size, 3), RGB, of the places with the numbers `rows` (k,), as a contract describes them."""

    def move(self, rows: Chosen, right: Floats, down: Floats) -> Mask:
        """Move places by shifts (k,) in expected radii. Returns which of them (k,) may hold an object there."""


class PlanePlaces:
    """Places on the plane that a camera of known lens and pose sees.

    centers (n, 3): of the objects that are expected there, relative to the camera in the mesh frame [m]; a copy is
    moved.
    """

    def __init__(self, observation: Observation, centers: Floats) -> None:
        self.centers = centers.copy()
        self._observation = observation
        self._tangents: Tangents | None = None  # of all places, until one moves

    def __len__(self) -> int:
        return len(self.centers)

    def cut(self, rows: Chosen, contract: LookContract) -> Image:
        """See Places."""
        nodes = patch_nodes(self._observation.view, self._planes(rows), contract.extent)
        return cut_patches(self._observation.pyramid, nodes, contract.size)

    def move(self, rows: Chosen, right: Floats, down: Floats) -> Mask:
        """See Places. A place that moves to the horizon or above it can't hold an object."""
        view = self._observation.view
        rays = self._planes(rows).rays(right, down)
        self.centers[rows] = view.shape.center_along(rays, view.height)
        self._tangents = None
        return np.asarray(rays[:, 2] < 0.0)

    def _planes(self, rows: Chosen) -> Tangents:
        """The planes of the patches around places with the numbers `rows` (k,)."""
        if self._tangents is None:
            self._tangents = Tangents.at(self._observation.view, self.centers)
        return self._tangents.part(rows)


def mean_center(view: PreparedView, centers: Floats, probabilities: Singles, number: int) -> Floats:
    """The center (3,) [m] of an object at a place: the mean of all places (c, 3) [m] near it, weighted by their
    probabilities (c,).

    Several proposals move to the same object, each with an error of its own. number: of the place.
    """
    rays = centers / np.linalg.norm(centers, axis=1, keepdims=True)
    near = view.shape.covers(rays, centers[[number]], view.height, _NEAR)[0]
    near[number] = True  # far away, rounding may leave it out
    return np.asarray(view.shape.center_along(((near * probabilities) @ rays)[None], view.height)[0])
