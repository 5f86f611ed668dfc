"""Scores of field lines: which share of the visible length is found, and which share of the reported length is wrong.

A sample of a line is right if it is within 5 cm or 3 % of its distance of a line of the other side, whichever is more.
Distances are on the plane, from the camera's foot. Scores without a value are NaN, never 0; `as_dict` writes None.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError

from .curves import Counts, ratio, without_nan
from .distance_bins import bins_of, checked_edges, named_bins
from .line_shapes import STEP, Lines
from .upright_scores import FIELD_EDGES

TOLERANCE = 0.05
"""Least tolerance [m]."""

RELATIVE = 0.03
"""Tolerance as a share of the distance."""


class LineScores:
    """Scores of the lines in all pictures so far, kept as counts of samples.

    limit [m]: distance up to which lines should be found. edges (D + 1,) [m]: bins include their lower edge. Raises
    InputError for edges that do not rise.
    """

    def __init__(self, limit: float = 6.0, edges: Floats = FIELD_EDGES) -> None:
        self.limit = limit
        self.edges = checked_edges(edges)
        self.pictures = 0
        # Visible, found, reported and wrong samples in each bin: up to the limit, then beyond it and outside all bins.
        self._counts: Counts = np.zeros((4, len(self.edges), 2), dtype=np.int64)

    def add(self, true: Lines, visible: Floats, reported: Lines, shown: Floats) -> None:
        """Add a picture. visible (n, 2) [m]: samples of the true lines. shown (m, 2) [m]: of the reported lines."""
        self._count(0, visible)
        self._count(1, visible[reported.distances(visible) <= tolerances(visible)])
        self._count(2, shown)
        self._count(3, shown[true.distances(shown) > tolerances(shown)])
        self.pictures += 1

    def _count(self, what: int, points: Floats) -> None:
        distances = np.hypot(*points.T)
        np.add.at(self._counts[what], (bins_of(distances, self.edges), (distances >= self.limit).astype(np.intp)), 1)

    def __add__(self, other: LineScores) -> LineScores:
        """Scores of the pictures of both. Raises InputError if their rules differ."""
        if self.limit != other.limit or not np.array_equal(self.edges, other.edges):
            raise InputError("scores with different distance bins or limits do not add up")
        both = LineScores(self.limit, self.edges)
        both.pictures = self.pictures + other.pictures
        both._counts = self._counts + other._counts
        return both

    def row(self, distance_bin: int | None = None) -> dict[str, Any]:
        """Lengths [m] and shares of a distance bin, from 0, or of all distances."""
        chosen = self._counts if distance_bin is None else self._counts[:, [distance_bin]]
        return _row(chosen.sum(axis=(1, 2)))

    def near_row(self) -> dict[str, Any]:
        """Lengths [m] and shares up to the limit."""
        return _row(self._counts[:, :, 0].sum(axis=1))

    def as_dict(self) -> dict[str, Any]:
        """All numbers, for JSON: over all distances, up to the limit and in each bin."""
        bins = {name: self.row(number) for name, number in named_bins(self.edges).items()}
        return {"pictures": self.pictures, "limit": self.limit, "near": self.near_row(), **bins}


def tolerances(points: Floats) -> Floats:
    """Largest distances (n,) [m] of points (n, 2) from a line that is theirs."""
    return np.asarray(np.maximum(TOLERANCE, RELATIVE * np.hypot(*points.T)))


def _row(counts: Counts) -> dict[str, Any]:
    visible, found, reported, wrong = counts.tolist()
    lengths = {"visible": visible, "found": found, "reported": reported, "wrong": wrong}
    values = {"recall": ratio(found, visible), "wrong_share": ratio(wrong, reported)}
    return {name: round(count * STEP, 2) for name, count in lengths.items()} | without_nan(values)
