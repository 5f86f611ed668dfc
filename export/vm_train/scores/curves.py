"""The base of the scores of points and of objects: the outcome at a threshold, and the precision-recall curve.

Scores without a value, such as the recall of a class that does not occur, are NaN, never 0; `without_nan` turns them
into None for JSON.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats

Counts = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Outcome:
    """Numbers of true positives (hits), false positives (false) and false negatives (missed) at a threshold."""

    hits: int
    false: int
    missed: int

    @property
    def precision(self) -> float:
        """Share of the reported ones that are right; NaN if nothing was reported."""
        return ratio(self.hits, self.hits + self.false)

    @property
    def recall(self) -> float:
        """Share of the true ones that were reported; NaN if there are none."""
        return ratio(self.hits, self.hits + self.missed)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall, 0 without a hit; NaN if there is nothing to find."""
        if self.hits + self.missed == 0:
            return math.nan
        return ratio(2 * self.hits, 2 * self.hits + self.false + self.missed)


@dataclass(frozen=True, eq=False)
class PrecisionRecall:
    """Precision and recall (m,) at falling thresholds (m,); each threshold reports more than the one before.

    The paper's fig:pr_curve. positives: number of true ones; without any, recall is NaN.
    """

    thresholds: Floats
    precision: Floats
    recall: Floats
    positives: int

    @property
    def average_precision(self) -> float:
        """Area under the curve by the rule of Pascal VOC since 2010; NaN if there is nothing to find.

        The paper's fig:pr_map shows it over distance. The precision at a recall is the highest at this recall or above,
        so the curve falls in steps, and the area is the sum over all steps. COCO averages the same steps at 101
        recalls.
        """
        if self.positives == 0:
            return math.nan
        highest = np.maximum.accumulate(self.precision[::-1])[::-1]
        return float(np.diff(self.recall, prepend=0.0) @ highest)


def ratio(part: float, whole: float) -> float:
    """part / whole, NaN if whole is 0."""
    return part / whole if whole else math.nan


def shares(parts: Counts, whole: int) -> Floats:
    """parts (m,) / whole, NaN if whole is 0."""
    return parts / whole if whole else np.full(len(parts), np.nan)


def without_nan(values: dict[str, float]) -> dict[str, float | None]:
    """The same values with None for NaN, which JSON does not have."""
    return {name: None if math.isnan(value) else value for name, value in values.items()}
