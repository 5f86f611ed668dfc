"""Found objects ranked by confidence: precision, recall, false objects, and errors of place.

Scores without a value, such as the recall without any true object, are NaN, never 0; `as_dict` writes None.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask

from .calibration import Reliability
from .curves import Outcome, PrecisionRecall, ratio, shares, without_nan


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors of correctly found objects, in meters unless stated, and their number. All are NaN if there are none.

    distance_*: absolute error of the distance. bias, low, high: median, 10 % and 90 % quantile of the signed error,
    positive if found too far away. relative_*: absolute error over the true distance. place_*: distance on the plane
    from the true to the found position. center_*: angle between the rays to the true and the found center, over the
    true angular radius.
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
    center_median: float
    center_p90: float


@dataclass(frozen=True)
class ObjectOutcome(Outcome):
    """Numbers of objects found (hits), missed and false, and of pictures."""

    pictures: int

    @property
    def false_per_picture(self) -> float:
        """Mean number of false objects per picture (paper: fig:ball_detection_images_1); NaN without pictures."""
        return ratio(self.false, self.pictures)


@dataclass(frozen=True, eq=False, kw_only=True)
class Ranking:
    """The found objects that count, at one overlap.

    confidence (m,). right (m,): whether it matches a true object. truths: number of true objects that count. pictures:
    number of all pictures.
    """

    confidence: Floats
    right: Mask
    truths: int
    pictures: int

    @classmethod
    def empty(cls) -> Ranking:
        """Of no pictures."""
        return Ranking(confidence=np.empty(0), right=np.empty(0, dtype=np.bool_), truths=0, pictures=0)

    def __add__(self, other: Ranking) -> Ranking:
        """What was found in the pictures of both."""
        return Ranking(
            confidence=np.concatenate([self.confidence, other.confidence]),
            right=np.concatenate([self.right, other.right]),
            truths=self.truths + other.truths,
            pictures=self.pictures + other.pictures,
        )

    @cached_property
    def precision_recall(self) -> PrecisionRecall:
        """The curve over all confidences (paper: fig:pr_curve).

        If there are true objects and none is found, its average precision is 0.
        """
        order = np.argsort(-self.confidence)
        ranked, hits = self.confidence[order], np.cumsum(self.right[order], dtype=np.int64)
        # Equal confidences count together, so the curve does not depend on the order of the pictures.
        last = np.flatnonzero(np.diff(ranked, append=-np.inf))  # of each group of equal confidences
        return PrecisionRecall(ranked[last], hits[last] / (last + 1.0), shares(hits[last], self.truths), self.truths)

    @cached_property
    def reliability(self) -> Reliability:
        """Share of right objects in bins of confidence."""
        return Reliability.of(self.confidence, self.right)

    def at(self, confidence: float = 0.0) -> ObjectOutcome:
        """The outcome if all objects of at least this confidence are reported."""
        reported = self.confidence >= confidence
        hits = int((self.right & reported).sum())
        return ObjectOutcome(hits, int(reported.sum()) - hits, self.truths - hits, self.pictures)


@dataclass(frozen=True, eq=False, kw_only=True)
class ObjectRanking(Ranking):
    """The same with errors of place: true_distance, found_distance, place_error (m,) [m], center_error (m,) [apparent
    radii]. True distance and errors of false objects are NaN. pictures: whatever the distance.
    """

    true_distance: Floats
    found_distance: Floats
    place_error: Floats
    center_error: Floats

    def errors(self, confidence: float = 0.0) -> Errors:
        """Errors of the correctly found objects of at least this confidence whose true position is known."""
        chosen = self.right & (self.confidence >= confidence) & np.isfinite(self.true_distance + self.found_distance)
        true = self.true_distance[chosen]
        signed = self.found_distance[chosen] - true
        absolute = np.abs(signed)
        away = true > 0.0  # below the camera, a relative error is undefined
        relative = absolute[away] / true[away]
        place, center = self.place_error[chosen], self.center_error[chosen]
        center = center[np.isfinite(center)]
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
            center_median=_quantile(center, 0.5),
            center_p90=_quantile(center, 0.9),
        )

    def as_dict(self, confidence: float = 0.0) -> dict[str, Any]:
        """All numbers except curve and reliability, for JSON."""
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
    """The quantile of values (n,) for a share from 0 to 1; NaN without values."""
    return float(np.quantile(values, share)) if len(values) else math.nan
