"""Which points of a batch give gradients.

The paper balances classes by selecting, not by weighing: weighed networks overfitted on the field. Its second and third
rounds select points by how wrong the network of the round before was on them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Mask, Singles
from vm_embedded.errors import InputError, unknown

from .pictures import Labels

RULES = ("all", "balanced", "hard")
"""all: every labeled point. balanced: as many of each class as of the rarest. hard: balanced, by probability."""

FLOOR = 0.05
"""Probability of selecting a point that no network was wrong about (the paper's 5 % baseline)."""


def selected(rule: str, labels: Labels, classes: int, errors: Singles | None, random: np.random.Generator) -> Mask:
    """Points (n,) that are selected from labels (n,), -1 for unlabeled.

    errors (n,): for rule hard the summed errors of the rounds before, 0 to their number, at each point; the chance of a
    point within its class is this plus FLOOR. Classes without points in the batch are left out. Raises InputError for
    an unknown rule, or if rule hard has no errors.
    """
    labeled = labels >= 0
    if rule == "all":
        return labeled
    if rule not in RULES:
        raise InputError(unknown("selection", rule, RULES))
    if rule == "hard" and errors is None:
        raise InputError("selection hard needs the errors of a network that was trained before")
    counts = np.bincount(labels[labeled], minlength=classes)
    if not counts.any():
        return labeled
    each = int(counts[counts > 0].min())
    chosen = np.zeros(len(labels), dtype=bool)
    for number in np.flatnonzero(counts):
        members = np.flatnonzero(labels == number)
        chance = None if errors is None or rule != "hard" else _chance(errors[members])
        chosen[random.choice(members, each, replace=False, p=chance)] = True
    return chosen


def _chance(errors: Singles) -> npt.NDArray[np.float64]:
    weights = np.minimum(errors.astype(np.float64), 1.0) + FLOOR
    return np.asarray(weights / weights.sum())


def errors_of(probabilities: Singles, labels: Labels) -> Singles:
    """How wrong (n,) a network's probabilities (n, C) are: 1 minus that of the true class; 0 where unlabeled."""
    labeled = labels >= 0
    true = probabilities[np.arange(len(labels)), np.where(labeled, labels, 0)]
    return np.where(labeled, 1.0 - true, 0.0).astype(np.float32)
