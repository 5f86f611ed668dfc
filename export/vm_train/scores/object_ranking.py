"""Found objects in the order of their confidence: precision, recall, false ones, and errors of distance.

A score without a value, as the recall where no object is, is NaN, never 0; `as_dict` makes it None.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask

from .curves import Outcome, PrecisionRecall, ratio, shares, without_nan


@dataclass(frozen=True, eq=False)
class Errors:
    """Of found objects that are right: their number, and errors [m] of distance and of place on the plane.

    distance_*: of absolute errors. bias, low, high: median, 10 and 90 % quantiles of signed ones, above 0 if found too
    far. relative_*: of absolute errors over the true distance. place_*: from the true point on the plane to the found
    one. NaN if there is none.
    """

    count: int
    distance_median: float
    distance_p90: float
    bias: float
    low: float
    high: float
    relative_median: float
    relative_p90: float
    place_median: float
    place_p90: float


@dataclass(frozen=True)
class ObjectOutcome(Outcome):
    """Numbers of objects that were found (hits) or not (missed), of false ones, and of pictures."""

    pictures: int

    @property
    def false_per_picture(self) -> float:
        """False ones in a picture; NaN without pictures."""
        return ratio(self.false, self.pictures)


@dataclass(frozen=True, eq=False)
class ObjectRanking:
    """Found objects that count, at one overlap: of each confidence (m,), whether it is right (m,), true and found
    distance (m,) [m], and error of place (m,) [m]; true distance and place are NaN for false ones. truths: number of
    true objects that count. pictures: number of pictures, of all distances."""

    confidence: Floats
    right: Mask
    true_distance: Floats
    found_distance: Floats
    place_error: Floats
    truths: int
    pictures: int

    @cached_property
    def precision_recall(self) -> PrecisionRecall:
        """The curve over all confidences. Its average precision is 0 if there are objects and none is found."""
        order = np.argsort(-self.confidence)
        ranked, hits = self.confidence[order], np.cumsum(self.right[order], dtype=np.int64)
        # Equals are reported together, so that the curve does not depend on the order of pictures.
        last = np.flatnonzero(np.diff(ranked, append=-np.inf))  # of each group of equals
        return PrecisionRecall(ranked[last], hits[last] / (last + 1.0), shares(hits[last], self.truths), self.truths)

    def at(self, confidence: float = 0.0) -> ObjectOutcome:
        """What comes of reporting all of this confidence or above."""
        reported = self.confidence >= confidence
        hits = int((self.right & reported).sum())
        return ObjectOutcome(hits, int(reported.sum()) - hits, self.truths - hits, self.pictures)

    def errors(self, confidence: float = 0.0) -> Errors:
        """Errors of the right ones of this confidence or above whose true place is known."""
        chosen = self.right & (self.confidence >= confidence) & np.isfinite(self.true_distance + self.found_distance)
        true = self.true_distance[chosen]
        signed = self.found_distance[chosen] - true
        absolute = np.abs(signed)
        away = true > 0.0  # straight below the camera no error is a share of the distance
        relative = absolute[away] / true[away]
        place = self.place_error[chosen]
        return Errors(
            count=len(true),
            distance_median=_quantile(absolute, 0.5),
            distance_p90=_quantile(absolute, 0.9),
            bias=_quantile(signed, 0.5),
            low=_quantile(signed, 0.1),
            high=_quantile(signed, 0.9),
            relative_median=_quantile(relative, 0.5),
            relative_p90=_quantile(relative, 0.9),
            place_median=_quantile(place, 0.5),
            place_p90=_quantile(place, 0.9),
        )

    def as_dict(self, confidence: float = 0.0) -> dict[str, Any]:
        """All numbers but the curve, for JSON."""
        outcome = self.at(confidence)
        counts = {"truths": self.truths, "pictures": self.pictures, "hits": outcome.hits, "false": outcome.false}
        values = {
            "average_precision": self.precision_recall.average_precision,
            "confidence": confidence,
            "precision": outcome.precision,
            "recall": outcome.recall,
            "f1": outcome.f1,
            "false_per_picture": outcome.false_per_picture,
        }
        return counts | without_nan(values) | {"errors": without_nan(vars(self.errors(confidence)))}


def _quantile(values: npt.NDArray[np.float64], share: float) -> float:
    """Value below which that share of the values (n,) is; NaN if there is none."""
    return float(np.quantile(values, share)) if len(values) else math.nan
