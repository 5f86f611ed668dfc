"""How good a look network's answers to labeled patches are."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch

from vm_embedded.arrays import Floats, Mask, Singles
from vm_export.look_network import LookNetwork

from ..scores.calibration import Calibration
from ..scores.curves import without_nan
from ..scores.object_ranking import Ranking
from .labels import OBJECT
from .patch_set import PatchSet

_BATCH = 1024

_REPORTED = 0.5
"""Probability from which objects count as reported in the result."""


@torch.no_grad()
def logits_of(network: LookNetwork, patches: PatchSet) -> Singles:
    """Outputs (n, 4) of a network for patches, each about the class of the patch: logit, right, down and log size."""
    device, images = network.calibration.device, patches.patches
    parts = [
        network.logits(torch.from_numpy(images[start : start + _BATCH]).to(device)).cpu().numpy()
        for start in range(0, len(images), _BATCH)
    ]
    if not parts:
        return np.empty((0, 4), dtype=np.float32)
    return np.asarray(np.concatenate(parts)[np.arange(len(patches)), patches.kinds])


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
        presence, count = logits[:, 0].astype(np.float64), int(right.sum())
        ranking = Ranking(confidence=presence, right=right, truths=count, pictures=0)
        precision = ranking.precision_recall.average_precision
        if not count:
            return cls(precision, np.nan, np.nan)
        errors = logits[right, 1:] - patches.targets[right]
        center = np.hypot(errors[:, 0], errors[:, 1])
        return cls(precision, float(np.median(center)), float(np.median(np.abs(errors[:, 2]))))


def balanced_loss(logits: Floats, shown: Mask) -> float:
    """Mean cross-entropy of logits (n,), where patches with and those without an object weigh the same; NaN if one kind
    is missing. shown (n,): whether a patch shows an object."""
    if not 0 < shown.sum() < len(shown):
        return np.nan
    losses = np.logaddexp(0.0, np.where(shown, -logits, logits))
    return float(0.5 * losses[shown].mean() + 0.5 * losses[~shown].mean())


def result_in_words(found: Ranking) -> str:
    """What a network finds in the validation pictures, with its calibrated probabilities."""
    outcome = found.at(_REPORTED)
    return (
        f"in {found.pictures} validation pictures it finds {outcome.hits} of {found.truths} visible objects, and "
        f"{outcome.false} false ones, at probability {_REPORTED:g}; average precision "
        f"{found.precision_recall.average_precision:.3f}, calibration error {found.reliability.error:.3f}"
    )


def result_values(found: Ranking, calibration: Calibration) -> dict[str, Any]:
    """The same for result.json. Objects that are not proposed lower the average precision."""
    outcome, reliability = found.at(_REPORTED), found.reliability
    precision = found.precision_recall.average_precision
    return {
        "pictures": found.pictures,
        "objects": found.truths,
        **without_nan({"average_precision": precision, "calibration_error": reliability.error}),
        f"at_probability_{_REPORTED:g}": {"hits": outcome.hits, "false": outcome.false},
        "calibration": asdict(calibration),
        "bins": reliability.rows(),
    }
