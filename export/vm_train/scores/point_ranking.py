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
"""Bins of a histogram of probabilities."""

PROBABILITY_EDGES: Floats = 0.5 + 0.5 * np.sin(np.pi * (np.arange(BINS + 1) / BINS - 0.5))
"""Edges (BINS + 1,) of the histograms, equally far apart in arcsin(sqrt(p)); 0, 0.5 and 1 are among them.

Trained networks give probabilities near 0 and 1, so bins are narrow there, to keep the order of points: 6e-7 at the
ends, and 8e-4 in the middle. A bin includes its lower edge; the last bin also includes its upper edge.
"""


@dataclass(frozen=True, eq=False)
class Roc:
    """The ROC curve: false and true positive rates (m + 1,) at falling thresholds (m + 1,), from (0, 0) to (1, 1).

    The first threshold is infinite. Without points of the class, the true positive rate is NaN; without other points,
    the false positive rate is NaN.
    """

    thresholds: Floats
    false_positive_rate: Floats
    true_positive_rate: Floats

    @property
    def area(self) -> float:
        """Area under the curve by the trapezoidal rule; NaN if one of the rates is.

        It is the chance that a point of the class has a higher probability than another point; equal ones count half.
        """
        if math.isnan(self.true_positive_rate[-1] + self.false_positive_rate[-1]):
            return math.nan
        heights = (self.true_positive_rate[1:] + self.true_positive_rate[:-1]) / 2.0
        return float(np.diff(self.false_positive_rate) @ heights)


@dataclass(frozen=True)
class PointOutcome(Outcome):
    """Numbers of points at a threshold: of the class (hits, missed), and of other classes (false, rejected)."""

    rejected: int

    @property
    def mcc(self) -> float:
        """Matthews correlation coefficient, -1 to 1; NaN if all points have the same truth or the same answer."""
        product = (self.hits + self.false) * (self.missed + self.rejected) * self._positives * self._negatives
        return ratio(self.hits * self.rejected - self.false * self.missed, math.sqrt(product))

    @property
    def informedness(self) -> float:
        """Recall plus the share of other points that are rejected, minus 1; NaN if all points have the same truth."""
        return self.recall + ratio(self.rejected, self._negatives) - 1.0

    @property
    def markedness(self) -> float:
        """Precision plus the correct share of the rejected points, minus 1.

        NaN if all points have the same truth or the same answer.
        """
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
    """Histograms of a class's probability: counts (BINS,) of all other points, and of the class's own points."""

    others: Counts
    own: Counts

    @property
    def positives(self) -> int:
        """Number of points of the class."""
        return int(self.own.sum())

    @property
    def negatives(self) -> int:
        """Number of points of all other classes."""
        return int(self.others.sum())

    @cached_property
    def _steps(self) -> tuple[Floats, Counts, Counts]:
        """Thresholds (m,), and the numbers (m,) of points at or above them: of the class, and of the others."""
        taken = np.flatnonzero(self.own + self.others)[::-1]
        return PROBABILITY_EDGES[taken], np.cumsum(self.own[taken]), np.cumsum(self.others[taken])

    @cached_property
    def precision_recall(self) -> PrecisionRecall:
        """The curve over all probabilities (paper: fig:pr_curve)."""
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
        """The outcome if points at or above a threshold count as the class; it is rounded to PROBABILITY_EDGES."""
        first = int(np.abs(PROBABILITY_EDGES[:-1] - threshold).argmin())
        hits, false = int(self.own[first:].sum()), int(self.others[first:].sum())
        return PointOutcome(hits, false, self.positives - hits, self.negatives - false)

    def as_dict(self, threshold: float = 0.5) -> dict[str, Any]:
        """All numbers except the curves, for JSON."""
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
