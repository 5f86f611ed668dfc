"""Scores of proposals, the places that the mesh network hands to the close look. An object missed here stays missed.

A true object counts as proposed if the ray to a proposal is near the ray to its center. How near is measured in the
object's apparent radii: the angle between the rays over the angle of the object's radius, both seen from the camera.
The same true objects are ignored as in `object_scores`. Several objects may share a proposal.

Scores without a value, such as the recall without any true object, are NaN, never 0; `as_dict` writes None.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError

from .curves import ratio, without_nan
from .distance_bins import DISTANCE_EDGES, bins_of, checked_edges, named_bins
from .object_scores import MIN_VISIBLE
from .overlaps import TrueObject

REACHES = (0.5, 1.0)
"""Largest offsets of a proposal from the true center, in apparent radii."""

RADIUS_EDGES: Floats = np.array([2.0, 3.0, 4.0, 6.0, 10.0, 20.0, 40.0, math.inf])
"""Edges of bins of the radius in the picture [px]."""

VISIBLE_EDGES: Floats = np.array([0.25, 0.4, 0.6, 0.8, 0.95, 1.0])
"""Edges of bins of the visible share. The last bin includes 1."""


@dataclass(frozen=True)
class ProposalRecall:
    """Numbers of true objects, and of those with a proposal within each of REACHES."""

    truths: int
    hits: tuple[int, ...]

    @property
    def recalls(self) -> tuple[float, ...]:
        """Share of the true objects with a proposal within each of REACHES; NaN if there are none."""
        return tuple(ratio(each, self.truths) for each in self.hits)

    def as_dict(self) -> dict[str, Any]:
        """All numbers, for JSON and CSV."""
        named = {f"recall_{reach:g}": share for reach, share in zip(REACHES, self.recalls, strict=True)}
        return {"truths": self.truths, **without_nan(named)}


@dataclass(frozen=True)
class _CountedTruth:
    """A true object that counts: distance on the plane [m], radius [px], visible share, and the offset of the nearest
    proposal [apparent radii], infinite without any."""

    distance: float
    radius: float
    visible: float
    offset: float


class ProposalScores:
    """Scores of the proposals in all pictures so far. They are exact: it keeps four numbers of every true object.

    distance_edges (D + 1,) [m]: bins include their lower edge. min_visible, min_radius [px]: true objects with a
    smaller visible share or radius are ignored. counts: number of proposals in each picture. Objects outside all bins
    count only in `recall()`. Raises InputError for edges that do not rise.
    """

    def __init__(
        self, distance_edges: Floats = DISTANCE_EDGES, min_visible: float = MIN_VISIBLE, min_radius: float = 0.0
    ) -> None:
        self.edges: Mapping[str, Floats] = {
            "distance": checked_edges(distance_edges),
            "radius": RADIUS_EDGES,
            "visible": VISIBLE_EDGES,
        }
        self.min_visible = min_visible
        self.min_radius = min_radius
        self.counts: list[int] = []
        self._truths: list[_CountedTruth] = []

    def add(self, truths: Sequence[TrueObject], centers: Floats) -> None:
        """Add a picture: its true objects, and the centers (c, 3) of the proposals.

        The centers are relative to the camera [m], in the frame of the true objects' bearings.
        """
        rays = centers / np.linalg.norm(centers, axis=1, keepdims=True)
        for each in truths:
            if not each.is_ignored(self.min_visible, self.min_radius):
                distance = math.hypot(float(each.position[0]), float(each.position[1]))
                offset = float(each.offsets(rays).min(initial=math.inf))
                self._truths.append(_CountedTruth(distance, each.radius, each.visible, offset))
        self.counts.append(len(centers))

    def __add__(self, other: ProposalScores) -> ProposalScores:
        """Scores of the pictures of both. Raises InputError if their rules differ."""
        if self._rules != other._rules:
            raise InputError("scores with different distance bins or limits for ignored objects do not add up")
        both = ProposalScores(self.edges["distance"], self.min_visible, self.min_radius)
        both.counts = self.counts + other.counts
        both._truths = self._truths + other._truths
        return both

    @property
    def _rules(self) -> tuple[Any, ...]:
        return self.edges["distance"].tolist(), self.min_visible, self.min_radius

    @property
    def mean_count(self) -> float:
        """Mean number of proposals per picture; NaN without pictures."""
        return ratio(sum(self.counts), len(self.counts))

    @property
    def largest_count(self) -> int:
        """Largest number of proposals in a picture; 0 without pictures."""
        return max(self.counts, default=0)

    def recall(self, min_radius: float = 0.0, min_visible: float = 0.0) -> ProposalRecall:
        """The recall of the true objects with at least this radius [px] and visible share."""
        _, radius, visible, offset = self._table.T
        return _recall(offset[(radius >= min_radius) & (visible >= min_visible)])

    def recalls_by(self, measure: str) -> dict[str, ProposalRecall]:
        """The recall in each bin of a measure: distance [m], radius [px] or visible, by the name of the bin."""
        table, edges = self._table, self.edges[measure]
        values = table[:, list(self.edges).index(measure)]
        if measure == "visible":
            values = np.minimum(values, np.nextafter(edges[-1], 0.0))
        bins = bins_of(values, edges)
        names = {name: number for name, number in named_bins(edges).items() if number is not None}
        return {name: _recall(table[bins == number, 3]) for name, number in names.items()}

    @property
    def _table(self) -> npt.NDArray[np.float64]:
        """Numbers (t, 4) of the true objects, in the order of _CountedTruth."""
        return np.array([astuple(each) for each in self._truths], dtype=np.float64).reshape(-1, 4)

    def as_dict(self) -> dict[str, Any]:
        """All numbers, for JSON."""
        counts = {"pictures": len(self.counts), **without_nan({"mean_count": self.mean_count})}
        bins = {
            f"by_{measure}": {name: each.as_dict() for name, each in self.recalls_by(measure).items()}
            for measure in self.edges
        }
        return {**counts, "largest_count": self.largest_count, "all": self.recall().as_dict(), **bins}


def _recall(offsets: Floats) -> ProposalRecall:
    """The recall of true objects whose nearest proposals have these offsets (t,) [apparent radii]."""
    return ProposalRecall(len(offsets), tuple(int((offsets <= reach).sum()) for reach in REACHES))
