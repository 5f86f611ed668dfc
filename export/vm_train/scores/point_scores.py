"""How well a network tells the classes of points apart, over all points and by their distance.

Scores are kept as counts: for each class and distance a histogram of the class's probability, for points of the class
and for all others, and a confusion matrix. They take the same memory for ten points as for ten billion, and those of
several processes add up.

A score without a value, as the recall of a class that does not occur, is NaN, never 0; `as_dict` makes it None.
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
"""By how much a softmax in single precision may be above 1."""


class PointScores:
    """Scores of all points so far.

    classes: names in the order of the network's outputs. distance_edges (D + 1,) [m]: of bins that include their lower
    edge. Points in no bin, as those without a distance above the horizon, count only where no bin is asked for. Raises
    InputError for edges that do not rise.
    """

    def __init__(self, classes: Sequence[str], distance_edges: Floats = DISTANCE_EDGES) -> None:
        self.classes = tuple(classes)
        self.distance_edges = checked_edges(distance_edges)
        rows, count = len(self.distance_edges), len(self.classes)  # the last row is for points in no bin
        self._histograms: Counts = np.zeros((count, rows, 2, BINS), dtype=np.int64)
        self._confusion: Counts = np.zeros((rows, count, count), dtype=np.int64)

    def add(self, probabilities: npt.NDArray[np.floating], labels: npt.NDArray[np.integer], distances: Floats) -> None:
        """Count points: probabilities (n, C), labels (n,) with -1 for unlabeled, distances (n,) on the plane [m], NaN
        or infinite where there is none.

        Unlabeled points count nowhere. Raises ModelError for probabilities that are not numbers from 0 to 1, and
        InputError for labels that no class has.
        """
        labeled = labels >= 0
        chosen, own = probabilities[labeled].astype(np.float64), labels[labeled].astype(np.intp)
        if not ((chosen >= 0.0) & (chosen <= 1.0 + _ROUNDING)).all():
            raise ModelError("the network's probabilities are not all numbers from 0 to 1")
        chosen = np.minimum(chosen, 1.0)
        if own.max(initial=0) >= len(self.classes):
            raise InputError(f"label {own.max()} is of no class; there are {len(self.classes)}")
        rows = bins_of(np.asarray(distances)[labeled], self.distance_edges)
        places = np.minimum(np.searchsorted(PROBABILITY_EDGES, chosen, side="right") - 1, BINS - 1)
        for number, histogram in enumerate(self._histograms):
            flat = (rows * 2 + (own == number)) * BINS + places[:, number]
            histogram += np.bincount(flat, minlength=histogram.size).reshape(histogram.shape)
        answers = chosen.argmax(axis=1)
        flat = (rows * len(self.classes) + own) * len(self.classes) + answers
        self._confusion += np.bincount(flat, minlength=self._confusion.size).reshape(self._confusion.shape)

    def __add__(self, other: PointScores) -> PointScores:
        """Scores of the points of both. Raises InputError if they have other classes or distances."""
        if self.classes != other.classes or not np.array_equal(self.distance_edges, other.distance_edges):
            raise InputError("scores of different classes or distances do not add up")
        both = PointScores(self.classes, self.distance_edges)
        both._histograms = self._histograms + other._histograms
        both._confusion = self._confusion + other._confusion
        return both

    def ranking(self, class_name: str, distance_bin: int | None = None) -> PointRanking:
        """Ranking by the probability of a class, of all points or of those in a bin, counted from 0. Raises InputError
        for an unknown class."""
        if class_name not in self.classes:
            raise InputError(unknown("class", class_name, self.classes))
        others, own = _rows(self._histograms[self.classes.index(class_name)], distance_bin)
        return PointRanking(others, own)

    def confusion(self, distance_bin: int | None = None) -> Counts:
        """Points (C, C) by true class (row) and by most probable class (column), of equals the first."""
        return _rows(self._confusion, distance_bin)


def _rows(counts: Counts, distance_bin: int | None) -> Counts:
    """Counts (D + 1, ...) of one bin, or of everything."""
    if distance_bin is None:
        return np.asarray(counts.sum(axis=0))
    return np.asarray(counts[range(len(counts) - 1)[distance_bin]])
