"""What scores of points and of objects have in common: outcomes of a threshold, and the curve over all of them.

A score without a value, as the recall of what does not occur, is NaN, never 0; `without_nan` makes it None for JSON.
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
    """Numbers of what was reported rightly (hits) and wrongly (false), and of what was not but should be (missed)."""

    hits: int
    false: int
    missed: int

    @property
    def precision(self) -> float:
        """Share of what was reported that is right; NaN if nothing was."""
        return ratio(self.hits, self.hits + self.false)

    @property
    def recall(self) -> float:
        """Share of what there is that was reported; NaN if there is nothing."""
        return ratio(self.hits, self.hits + self.missed)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall, 0 without a hit; NaN if there is nothing to be found."""
        if self.hits + self.missed == 0:
            return math.nan
        return ratio(2 * self.hits, 2 * self.hits + self.false + self.missed)


@dataclass(frozen=True, eq=False)
class PrecisionRecall:
    """Precision and recall (m,) of what is at or above thresholds (m,), falling; without thresholds that add nothing.
    positives: what there is to be found; if it is 0, recall is NaN."""

    thresholds: Floats
    precision: Floats
    recall: Floats
    positives: int

    @property
    def average_precision(self) -> float:
        """Area under the curve as Pascal VOC takes it since 2010; NaN if there is nothing to be found.

        The precision at a recall is the highest that is reached at that recall or above, so the curve falls in steps,
        and the area is the sum over all its steps. COCO takes the mean of the same steps at 101 recalls.
        """
        if self.positives == 0:
            return math.nan
        highest = np.maximum.accumulate(self.precision[::-1])[::-1]
        return float(np.diff(self.recall, prepend=0.0) @ highest)


def ratio(part: float, whole: float) -> float:
    """part / whole, NaN if there is no whole."""
    return part / whole if whole else math.nan


def shares(parts: Counts, whole: int) -> Floats:
    """parts (m,) / whole, NaN if there is no whole."""
    return parts / whole if whole else np.full(len(parts), np.nan)


def without_nan(values: dict[str, float]) -> dict[str, float | None]:
    """The same with None for NaN, which JSON does not have."""
    return {name: None if math.isnan(value) else value for name, value in values.items()}
