"""How good a look network's answers to labeled patches are."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch

from vm_embedded.arrays import Floats, Image, Mask, Singles
from vm_export.look_network import LookNetwork

from ..scores.calibration import Calibration, Reliability
from ..scores.curves import PrecisionRecall, without_nan
from .judging import Found
from .labels import OBJECT
from .patch_set import PatchSet

_BATCH = 1024


@torch.no_grad()
def logits_of(network: LookNetwork, patches: Image) -> Singles:
    """Outputs (n, 4) of a network for patches: logit, right, down and log size."""
    device = network.calibration.device
    parts = [
        network.logits(torch.from_numpy(patches[start : start + _BATCH]).to(device)).cpu().numpy()
        for start in range(0, len(patches), _BATCH)
    ]
    return np.concatenate(parts) if parts else np.empty((0, 4), dtype=np.float32)


@dataclass(frozen=True)
class LookScore:
    """Scores of a network on labeled patches.

    average_precision: 0 to 1, NaN without an object. center_error: median distance from the true to the found center,
    in expected radii, of patches that show an object; size_error: median absolute error of the logarithm of the size.
    """

    average_precision: float
    center_error: float
    size_error: float

    @classmethod
    def of(cls, logits: Singles, patches: PatchSet) -> LookScore:
        """The scores of outputs (n, 4), as `logits_of` returns them."""
        right = patches.labels == OBJECT
        precision = average_precision(logits[:, 0].astype(np.float64), right)
        if not right.any():
            return cls(precision, np.nan, np.nan)
        errors = logits[right, 1:] - patches.targets[right]
        center = np.hypot(errors[:, 0], errors[:, 1])
        return cls(precision, float(np.median(center)), float(np.median(np.abs(errors[:, 2]))))


def average_precision(confidence: Floats, right: Mask, truths: int | None = None) -> float:
    """Average precision of answers with a confidence (n,), of which some are right (n,).

    truths: number of right answers that are possible, if it is not that of the right ones. NaN if none is possible.
    """
    order = np.argsort(-confidence, kind="stable")
    ranked, hits = confidence[order], np.cumsum(right[order], dtype=np.int64)
    last = np.flatnonzero(np.diff(ranked, append=-np.inf))  # equal confidences count together
    count = int(right.sum()) if truths is None else truths
    return PrecisionRecall(ranked[last], hits[last] / (last + 1.0), hits[last] / max(count, 1), count).average_precision


def balanced_loss(logits: Floats, shown: Mask) -> float:
    """Mean cross-entropy of logits (n,), where patches with and those without an object weigh the same; NaN if one kind
    is missing. shown (n,): whether a patch shows an object."""
    if not 0 < shown.sum() < len(shown):
        return np.nan
    losses = np.logaddexp(0.0, np.where(shown, -logits, logits))
    return float(0.5 * losses[shown].mean() + 0.5 * losses[~shown].mean())


@dataclass(frozen=True)
class LookResult:
    """How good what a network finds in the validation pictures is; result.json holds it.

    pictures, objects: number of pictures, and of visible objects in them. average_precision: of the objects that are
    found, 0 to 1; objects that are not proposed lower it. hits, false: right and wrong ones with a calibrated
    probability of at least 0.5. calibration_error: mean difference between probability and share of right ones, over
    bins.
    """

    pictures: int
    objects: int
    average_precision: float
    hits: int
    false: int
    calibration: Calibration
    reliability: Reliability

    @classmethod
    def of(cls, found: Found, calibration: Calibration) -> LookResult:
        """The result with a calibration."""
        probabilities = calibration.probabilities(found.logits)
        reported = probabilities >= 0.5
        return cls(
            found.pictures,
            found.objects,
            average_precision(found.logits, found.right, found.objects),
            int((reported & found.right).sum()),
            int((reported & ~found.right).sum()),
            calibration,
            Reliability.of(probabilities, found.right),
        )

    @property
    def calibration_error(self) -> float:
        """Expected calibration error; NaN if nothing was found."""
        return self.reliability.error

    def __str__(self) -> str:
        return (
            f"in {self.pictures} validation pictures it finds {self.hits} of {self.objects} visible objects, and "
            f"{self.false} false ones, at probability 0.5; average precision {self.average_precision:.3f}, calibration "
            f"error {self.calibration_error:.3f}"
        )

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON; None for what has no value."""
        values = {"average_precision": self.average_precision, "calibration_error": self.calibration_error}
        return {
            "pictures": self.pictures,
            "objects": self.objects,
            **without_nan(values),
            "at_probability_0.5": {"hits": self.hits, "false": self.false},
            "calibration": asdict(self.calibration),
            "bins": self.reliability.rows(),
        }
