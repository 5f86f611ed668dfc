"""Places in a picture to look at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from ..arrays import Chosen, Floats, Image, Mask, Singles
from ..network.look_contract import LookContract
from .patches import Tangents, cut_patches, patch_nodes
from .prepared_view import PreparedView
from .pyramid import Pyramid

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

    view: of the objects that are expected there. centers (n, 3): of these, relative to the camera in the mesh frame
    [m]; a copy is moved.
    """

    def __init__(self, pyramid: Pyramid, view: PreparedView, centers: Floats) -> None:
        self.view, self.centers = view, centers.copy()
        self._pyramid = pyramid
        self._tangents: Tangents | None = None  # of all places, until one moves
        self._patches: Image | None = None  # the same

    def __len__(self) -> int:
        return len(self.centers)

    def cut(self, rows: Chosen, contract: LookContract) -> Image:
        """See Places."""
        if self._patches is not None:
            return self._patches[rows]
        nodes = patch_nodes(self.view, self._planes(rows), contract.extent)
        return cut_patches(self._pyramid, nodes, contract.size)

    def move(self, rows: Chosen, right: Floats, down: Floats) -> Mask:
        """See Places. A place that moves to the horizon or above it can't hold an object."""
        rays = self._planes(rows).rays(right, down)
        self.centers[rows] = self.view.shape.center_along(rays, self.view.height)
        self._tangents = self._patches = None
        return np.asarray(rays[:, 2] < 0.0)

    def keep(self, tangents: Tangents, patches: Image) -> None:
        """Use these planes and patches until a place moves."""
        self._tangents, self._patches = tangents, patches

    def _planes(self, rows: Chosen) -> Tangents:
        """The planes of the patches around places with the numbers `rows` (k,)."""
        if self._tangents is None:
            self._tangents = Tangents.at(self.view, self.centers)
        return self._tangents.part(rows)


def cut_together(pyramid: Pyramid, places: Sequence[PlanePlaces], contracts: Sequence[LookContract]) -> None:
    """Cut the patches of all places at once, each as its contract describes it, which takes half the time.

    All places are of one camera.
    """
    if len(places) < 2 or len({each.size for each in contracts}) > 1:
        return
    counts = [len(each) for each in places]
    sizes = np.repeat([each.view.shape.half_size for each in places], counts)
    tangents = Tangents.around(np.concatenate([each.centers for each in places]), sizes)
    nodes = patch_nodes(places[0].view, tangents, np.repeat([each.extent for each in contracts], counts))
    patches = cut_patches(pyramid, nodes, contracts[0].size)
    ends = np.cumsum(counts).tolist()
    for each, end in zip(places, ends, strict=True):
        rows = np.arange(end - len(each), end)
        each.keep(tangents.part(rows), patches[rows])


def mean_center(view: PreparedView, centers: Floats, probabilities: Singles, number: int) -> Floats:
    """The center (3,) [m] of an object at a place: the mean of all places (c, 3) [m] near it, weighted by their
    probabilities (c,).

    Several proposals move to the same object, each with an error of its own. number: of the place.
    """
    rays = centers / np.linalg.norm(centers, axis=1, keepdims=True)
    near = view.shape.covers(rays, centers[[number]], view.height, _NEAR)[0]
    near[number] = True  # far away, rounding may leave it out
    return np.asarray(view.shape.center_along(((near * probabilities) @ rays)[None], view.height)[0])
