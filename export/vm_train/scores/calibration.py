"""Calibration of confidences: of the objects found with confidence 0.9, nine of ten should be right."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats, Mask

from .curves import without_nan

BINS = 15
"""Bins of confidence, equally wide."""

_STEPS = 50

_SPREAD = 1.645
"""Standard deviations on each side of the middle that hold 90 % of a normal distribution."""


@dataclass(frozen=True)
class Reliability:
    """Answers in bins of confidence: their numbers, mean confidences, and shares that are right, each (BINS,).

    Mean and share are NaN in an empty bin.
    """

    counts: tuple[int, ...]
    confidences: tuple[float, ...]
    right: tuple[float, ...]

    @classmethod
    def of(cls, confidence: Floats, right: Mask) -> Reliability:
        """The bins of answers with confidences (n,) from 0 to 1, of which some are right (n,).

        A bin includes its lower edge; the last one includes 1.
        """
        bins = np.clip((confidence * BINS).astype(np.intp), 0, BINS - 1)
        order = np.lexsort((right, confidence))  # sums have the same digits for every order of the answers
        bins, confidence, right = bins[order], confidence[order], right[order]
        counts = np.bincount(bins, minlength=BINS)
        with np.errstate(invalid="ignore"):
            confidences = np.bincount(bins, confidence, BINS) / counts
            shares = np.bincount(bins, right, BINS) / counts
        return cls(tuple(counts.tolist()), tuple(confidences.tolist()), tuple(shares.tolist()))

    @property
    def total(self) -> int:
        """Number of all answers."""
        return sum(self.counts)

    @property
    def error(self) -> float:
        """Expected calibration error (ECE): mean difference of confidence and share, weighted by the numbers.

        NaN without answers. With few of them it is above 0 even for a perfect calibration, because shares vary.
        """
        parts = (
            count * abs(confidence - share)
            for count, confidence, share in zip(self.counts, self.confidences, self.right, strict=True)
            if count
        )
        return sum(parts) / self.total if self.total else math.nan

    def intervals(self) -> tuple[Floats, Floats]:
        """Lower and upper limit (BINS,) of each share: the 90 % interval of Wilson; NaN in an empty bin."""
        count, share = np.array(self.counts, dtype=np.float64), np.array(self.right)
        with np.errstate(divide="ignore", invalid="ignore"):
            weight = _SPREAD**2 / count
            middle = (share + weight / 2.0) / (1.0 + weight)
            half = np.sqrt(weight * (share * (1.0 - share) + weight / 4.0)) / (1.0 + weight)
        return middle - half, middle + half

    def rows(self) -> list[dict[str, Any]]:
        """A row for each bin, for JSON and CSV; None for a value that an empty bin does not have."""
        edges = pairwise(round(number / BINS, 4) for number in range(BINS + 1))
        values = zip(edges, self.counts, self.confidences, self.right, strict=True)
        return [
            {"from": low, "to": high, "count": count, **without_nan({"confidence": confidence, "right": right})}
            for (low, high), count, confidence, right in values
        ]

    def as_dict(self) -> dict[str, Any]:
        """All numbers, for JSON."""
        return {"found": self.total, **without_nan({"expected_error": self.error}), "bins": self.rows()}


def logits_from(probabilities: Floats) -> Floats:
    """Logits (n,) of probabilities (n,), finite for 0 and 1, too."""
    p = np.clip(probabilities, 1e-9, 1.0 - 1e-7)
    return np.asarray(np.log(p / (1.0 - p)))


@dataclass(frozen=True)
class Calibration:
    """Scale and offset that turn a logit into that of a calibrated probability."""

    scale: float = 1.0
    offset: float = 0.0

    def probabilities(self, logits: Floats) -> Floats:
        """Calibrated probabilities (n,) of logits (n,)."""
        return np.asarray(0.5 + 0.5 * np.tanh(0.5 * (self.scale * logits + self.offset)))

    @classmethod
    def fit(cls, logits: Floats, right: Mask) -> Calibration:
        """The most likely calibration of logits (n,) of which some are right (n,).

        With Platt's targets, (a + 1) / (a + 2) for a right ones and 1 / (b + 2) for b wrong ones, so that a network
        without a mistake does not get an infinite scale. The scale is at least 0.001.
        """
        count, total = int(right.sum()), len(right)
        targets = np.where(right, (count + 1.0) / (count + 2.0), 1.0 / (total - count + 2.0))
        inputs = np.stack([logits, np.ones(total)], axis=1)
        weights = np.array([1.0, 0.0])
        loss = _loss(inputs @ weights, targets)
        for _ in range(_STEPS):
            p = 0.5 + 0.5 * np.tanh(0.5 * (inputs @ weights))
            curvature = (inputs * (p * (1.0 - p))[:, None]).T @ inputs + 1e-9 * np.eye(2)
            step = np.linalg.solve(curvature, inputs.T @ (p - targets))
            while (after := _loss(inputs @ (weights - step), targets)) > loss and np.abs(step).max() > 1e-9:
                step = 0.5 * step
            weights, gain, loss = weights - step, loss - after, after
            if gain < 1e-12 * max(loss, 1.0):
                break
        return cls(max(float(weights[0]), 1e-3), float(weights[1]))


def _loss(logits: Floats, targets: Floats) -> float:
    """Cross-entropy of logits (n,) with targets (n,)."""
    return float((np.logaddexp(0.0, logits) - targets * logits).sum())
