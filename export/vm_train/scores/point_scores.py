"""Scores of points: how well a network classifies them, over all distances and in each distance bin.

Scores are kept as counts: a confusion matrix, and for each class two histograms of its probability, one for points of
the class and one for all others; all of them by distance. They need the same memory for ten points as for ten billion,
and the scores of several processes add up.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError, ModelError, unknown

from .curves import Counts
from .distance_bins import DISTANCE_EDGES, bins_of, checked_edges
from .point_ranking import BINS, PROBABILITY_EDGES, PointRanking

_ROUNDING = 1e-6
"""The amount by which a softmax in single precision may exceed 1."""


class PointScores:
    """Scores of all points so far.

    classes: names in the order of the network's outputs. distance_edges (D + 1,) [m]: bins include their lower edge.
    Points outside all bins, for example above the horizon, count only in scores over all distances. Raises InputError
    for edges that do not rise.
    """

    def __init__(self, classes: Sequence[str], distance_edges: Floats = DISTANCE_EDGES) -> None:
        self.classes = tuple(classes)
        self.distance_edges = checked_edges(distance_edges)
        rows, count = len(self.distance_edges), len(self.classes)  # the last row is for points outside all bins
        self._histograms: Counts = np.zeros((count, rows, 2, BINS), dtype=np.int64)
        self._confusion: Counts = np.zeros((rows, count, count), dtype=np.int64)

    def add(self, probabilities: npt.NDArray[np.floating], labels: npt.NDArray[np.integer], distances: Floats) -> None:
        """Add points.

        probabilities (n, C). labels (n,): numbers of classes; points with -1 are unlabeled and do not count. distances
        (n,): on the plane [m]; NaN or infinite above the horizon. Raises ModelError for probabilities outside 0 to 1,
        and InputError for labels without a class.
        """
        labeled = labels >= 0
        chosen, own = probabilities[labeled].astype(np.float64), labels[labeled].astype(np.intp)
        if not ((chosen >= 0.0) & (chosen <= 1.0 + _ROUNDING)).all():
            raise ModelError("the network's probabilities are not all from 0 to 1")
        chosen = np.minimum(chosen, 1.0)
        if own.max(initial=0) >= len(self.classes):
            raise InputError(f"label {own.max()} has no class; the highest label is {len(self.classes) - 1}")
        rows = bins_of(np.asarray(distances)[labeled], self.distance_edges)
        places = np.minimum(np.searchsorted(PROBABILITY_EDGES, chosen, side="right") - 1, BINS - 1)
        for number, histogram in enumerate(self._histograms):
            flat = (rows * 2 + (own == number)) * BINS + places[:, number]
            histogram += np.bincount(flat, minlength=histogram.size).reshape(histogram.shape)
        answers = chosen.argmax(axis=1)
        flat = (rows * len(self.classes) + own) * len(self.classes) + answers
        self._confusion += np.bincount(flat, minlength=self._confusion.size).reshape(self._confusion.shape)

    def __add__(self, other: PointScores) -> PointScores:
        """Scores of the points of both. Raises InputError if their classes or distance bins differ."""
        if self.classes != other.classes or not np.array_equal(self.distance_edges, other.distance_edges):
            raise InputError("scores with different classes or distance bins do not add up")
        both = PointScores(self.classes, self.distance_edges)
        both._histograms = self._histograms + other._histograms
        both._confusion = self._confusion + other._confusion
        return both

    def ranking(self, class_name: str, distance_bin: int | range | None = None) -> PointRanking:
        """The ranking by the probability of a class, of all points or of those in one or several distance bins, from 0.

        Raises InputError for an unknown class.
        """
        if class_name not in self.classes:
            raise InputError(unknown("class", class_name, self.classes))
        others, own = _rows(self._histograms[self.classes.index(class_name)], distance_bin)
        return PointRanking(others, own)

    def confusion(self, distance_bin: int | None = None) -> Counts:
        """Points (C, C) by true class (row) and by most probable class (column); the first of equally probable ones."""
        return _rows(self._confusion, distance_bin)


def _rows(counts: Counts, distance_bin: int | range | None) -> Counts:
    """Counts of one or several bins from counts (D + 1, ...), or the sum of all for None."""
    if distance_bin is None:
        return np.asarray(counts.sum(axis=0))
    if isinstance(distance_bin, range):
        return np.asarray(counts[list(distance_bin)].sum(axis=0))
    return np.asarray(counts[range(len(counts) - 1)[distance_bin]])
