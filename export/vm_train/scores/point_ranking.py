"""The points of one class against all others, ranked by the class's probability: curves and scores.

Scores without a value, such as the recall of a class that does not occur, are NaN, never 0; `as_dict` writes None.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats

from .curves import Counts, Outcome, PrecisionRecall, ratio, shares, without_nan

BINS = 2048

PROBABILITY_EDGES: Floats = 0.5 + 0.5 * np.sin(np.pi * (np.arange(BINS + 1) / BINS - 0.5))
"""Edges (BINS + 1,) of the histograms, equally far apart in arcsin(sqrt(p)); 0, 0.5 and 1 are among them.

Trained networks answer near 0 and 1, and there the ranks are to be kept: the bins at the ends are 6e-7 wide, the widest
in the middle 8e-4. Bins include their lower edge, the last one also its upper.
"""


@dataclass(frozen=True, eq=False)
class Roc:
    """Outcome (m + 1,) of false and true positives at or above thresholds (m + 1,), from infinity and (0, 0) to (1, 1).
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
class PointOutcome(Outcome):
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
class PointRanking:
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

    def at(self, threshold: float) -> PointOutcome:
        """What comes of reporting all at or above a threshold; exact at PROBABILITY_EDGES, else at the nearest one."""
        first = int(np.abs(PROBABILITY_EDGES[:-1] - threshold).argmin())
        hits, false = int(self.own[first:].sum()), int(self.others[first:].sum())
        return PointOutcome(hits, false, self.positives - hits, self.negatives - false)

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
