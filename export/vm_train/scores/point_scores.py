"""How well a network tells the classes of points apart, over all points and by their distance.

Scores are kept as counts: for each class and distance a histogram of the class's probability, for points of the class
and for all others, and a confusion matrix. They take the same memory for ten points as for ten billion, and those of
several processes add up.

A score without a value, as the recall of a class that does not occur, is NaN, never 0; `as_dict` makes it None.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError, ModelError, unknown

from .curves import Counts, PrecisionRecall, Rates, ratio, shares, without_nan
from .distance_bins import DISTANCE_EDGES, bins_of, checked_edges

BINS = 2048

PROBABILITY_EDGES: Floats = 0.5 + 0.5 * np.sin(np.pi * (np.arange(BINS + 1) / BINS - 0.5))
"""Edges (BINS + 1,) of the histograms, equally far apart in arcsin(sqrt(p)); 0, 0.5 and 1 are among them.

Trained networks answer near 0 and 1, and there the ranks are to be kept: the bins at the ends are 6e-7 wide, the widest
in the middle 8e-4. Bins include their lower edge, the last one also its upper.
"""

_ROUNDING = 1e-6
"""By how much a softmax in single precision may be above 1."""


@dataclass(frozen=True, eq=False)
class Roc:
    """Rates (m + 1,) of false and true positives at or above thresholds (m + 1,), from infinity and (0, 0) to (1, 1).
    A rate is NaN if its class is empty."""

    thresholds: Floats
    false_positive_rate: Floats
    true_positive_rate: Floats

    @property
    def area(self) -> float:
        """Area under the straight lines between the points: the chance that a point of the class has the higher
        probability than one that is not, where equal ones count half. NaN without both kinds."""
        if math.isnan(self.true_positive_rate[-1] + self.false_positive_rate[-1]):
            return math.nan
        heights = (self.true_positive_rate[1:] + self.true_positive_rate[:-1]) / 2.0
        return float(np.diff(self.false_positive_rate) @ heights)


@dataclass(frozen=True)
class Outcome(Rates):
    """Numbers of points of a class that were taken for it (hits) or not (missed), and of all others that were taken
    for it (false) or not (rejected)."""

    rejected: int

    @property
    def mcc(self) -> float:
        """Matthews' correlation of truth and answer, -1 to 1; NaN if all are of one truth or of one answer."""
        product = (self.hits + self.false) * (self.missed + self.rejected) * self._positives * self._negatives
        return ratio(self.hits * self.rejected - self.false * self.missed, math.sqrt(product))

    @property
    def informedness(self) -> float:
        """Recall plus share of the others that was rejected, minus 1; NaN if all are of one truth."""
        return self.recall + ratio(self.rejected, self._negatives) - 1.0

    @property
    def markedness(self) -> float:
        """Precision plus share of the rejected that is right, minus 1; NaN if all are of one truth or of one answer."""
        if not (self._positives and self._negatives):
            return math.nan
        return self.precision + ratio(self.rejected, self.missed + self.rejected) - 1.0

    @property
    def _positives(self) -> int:
        return self.hits + self.missed

    @property
    def _negatives(self) -> int:
        return self.false + self.rejected


@dataclass(frozen=True, eq=False)
class Ranking:
    """How the points of a class and all others are ranked by its probability: counts (BINS,) of each."""

    others: Counts
    own: Counts

    @property
    def positives(self) -> int:
        """Points of the class."""
        return int(self.own.sum())

    @property
    def negatives(self) -> int:
        """Points of all other classes."""
        return int(self.others.sum())

    @cached_property
    def _steps(self) -> tuple[Floats, Counts, Counts]:
        """Thresholds (m,), and how many of the class and of the others are at or above them (m,)."""
        taken = np.flatnonzero(self.own + self.others)[::-1]
        return PROBABILITY_EDGES[taken], np.cumsum(self.own[taken]), np.cumsum(self.others[taken])

    @cached_property
    def precision_recall(self) -> PrecisionRecall:
        thresholds, hits, false = self._steps
        return PrecisionRecall(thresholds, hits / (hits + false), shares(hits, self.positives), self.positives)

    @cached_property
    def roc(self) -> Roc:
        thresholds, hits, false = self._steps
        return Roc(
            np.concatenate([[np.inf], thresholds]),
            shares(np.concatenate([[0], false]), self.negatives),
            shares(np.concatenate([[0], hits]), self.positives),
        )

    def at(self, threshold: float) -> Outcome:
        """What comes of reporting all at or above a threshold; exact at PROBABILITY_EDGES, else at the nearest one."""
        first = int(np.abs(PROBABILITY_EDGES[:-1] - threshold).argmin())
        hits, false = int(self.own[first:].sum()), int(self.others[first:].sum())
        return Outcome(hits, false, self.positives - hits, self.negatives - false)

    def as_dict(self, threshold: float = 0.5) -> dict[str, Any]:
        """All numbers but the curves, for JSON."""
        outcome = self.at(threshold)
        values = {
            "average_precision": self.precision_recall.average_precision,
            "roc_auc": self.roc.area,
            "threshold": threshold,
            "precision": outcome.precision,
            "recall": outcome.recall,
            "f1": outcome.f1,
            "mcc": outcome.mcc,
            "informedness": outcome.informedness,
            "markedness": outcome.markedness,
        }
        return {"points": self.positives, "others": self.negatives} | without_nan(values)


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

    def ranking(self, class_name: str, distance_bin: int | None = None) -> Ranking:
        """Ranking by the probability of a class, of all points or of those in a bin, counted from 0. Raises InputError
        for an unknown class."""
        if class_name not in self.classes:
            raise InputError(unknown("class", class_name, self.classes))
        others, own = _rows(self._histograms[self.classes.index(class_name)], distance_bin)
        return Ranking(others, own)

    def confusion(self, distance_bin: int | None = None) -> Counts:
        """Points (C, C) by true class (row) and by most probable class (column), of equals the first."""
        return _rows(self._confusion, distance_bin)


def _rows(counts: Counts, distance_bin: int | None) -> Counts:
    """Counts (D + 1, ...) of one bin, or of everything."""
    if distance_bin is None:
        return np.asarray(counts.sum(axis=0))
    return np.asarray(counts[range(len(counts) - 1)[distance_bin]])
