"""Scores of proposals, the places that the mesh network hands to the close look. An object missed here stays missed.

A true object counts as proposed if the ray to a proposal is near the ray to its center. How near is measured in the
object's apparent radii: the angle between the rays over the angle of the object's radius, both seen from the camera.
The same true objects are ignored as in `object_scores`. Several objects may share a proposal.

Scores without a value, such as the recall without any true object, are NaN, never 0; `as_dict` writes None.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats

from .curves import ratio, without_nan
from .distance_bins import DISTANCE_EDGES, bins_of, named_bins
from .object_scores import MIN_VISIBLE
from .overlaps import TrueObject

REACHES = (0.5, 1.0)
"""Largest offsets of a proposal from the true center, in apparent radii."""


class ProposalScores:
    """Scores of the proposals in all pictures so far. They are exact: it keeps two numbers of every true object.

    min_radius [px]: smaller true objects are ignored. counts: number of proposals in each picture.
    """

    def __init__(self, min_radius: float = 0.0) -> None:
        self.min_radius = min_radius
        self.counts: list[int] = []
        self._truths: list[tuple[float, float]] = []  # distance [m], offset of the nearest proposal [apparent radii]

    def add(self, truths: Sequence[TrueObject], centers: Floats) -> None:
        """Add a picture: its true objects, and the centers (c, 3) of the proposals.

        The centers are relative to the camera [m], in the frame of the true objects' bearings.
        """
        rays = centers / np.linalg.norm(centers, axis=1, keepdims=True)
        for each in truths:
            if not each.is_ignored(MIN_VISIBLE, self.min_radius):
                distance = math.hypot(float(each.position[0]), float(each.position[1]))
                self._truths.append((distance, float(each.offsets(rays).min(initial=math.inf))))
        self.counts.append(len(centers))

    def __add__(self, other: ProposalScores) -> ProposalScores:
        """Scores of the pictures of both, which must have the same `min_radius`."""
        both = ProposalScores(self.min_radius)
        both.counts = self.counts + other.counts
        both._truths = self._truths + other._truths
        return both

    def row(self, distance_bin: int | None = None) -> dict[str, Any]:
        """Number of true objects in a distance bin, from 0, or at all distances, and the share that is proposed."""
        distances, offsets = np.array(self._truths, dtype=np.float64).reshape(-1, 2).T
        if distance_bin is not None:
            offsets = offsets[bins_of(distances, DISTANCE_EDGES) == distance_bin]
        recalls = {f"recall_{reach:g}": ratio(int((offsets <= reach).sum()), len(offsets)) for reach in REACHES}
        return {"truths": len(offsets), **without_nan(recalls)}

    def as_dict(self) -> dict[str, Any]:
        """All numbers, for JSON: over all distances and in each bin."""
        pictures = len(self.counts)
        mean = without_nan({"mean_count": ratio(sum(self.counts), pictures)})
        counts = {"pictures": pictures, "largest_count": max(self.counts, default=0), **mean}
        return {**counts, **{name: self.row(number) for name, number in named_bins(DISTANCE_EDGES).items()}}
