"""Which points of a batch give gradients, and how much each counts.

The paper balances classes by selecting. Its second and third rounds select points by how wrong the networks of the
rounds before were on them. Weighing gives the same gradient in the mean from all points instead of some, so with less
noise; docs/results.md compares them.

Every point has a chance, and a number is drawn for each. So a class is as often selected as any other over the whole
set, not within each batch: there the rarest class may have a single point, or none.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask, Singles

from ..data.classes import Labels

RULES = ("all", "weighed", "balanced", "hard")
"""all: every labeled point. weighed: every labeled point, those of frequent classes counting less. balanced: as many of
each class as of the rarest object. hard: the same, and the points of a class by how wrong earlier networks were."""

FLOOR = 0.05
"""Weight of a point that no network was wrong about (the paper's 5 % baseline)."""


def selection_shares(rule: str, counts: npt.NDArray[np.int64], objects: Mask) -> Floats:
    """Share (C,) of each class's points that is selected, from its number of points in the set (C,).

    objects (C,): which classes are objects. The rarest of them says how many points of a class are selected, or the
    rarest class if there are no objects. Classes that are rarer still are taken whole: else a single point of an odd
    class would leave nothing to learn from.
    """
    occurring = counts[objects & (counts > 0)] if (objects & (counts > 0)).any() else counts[counts > 0]
    if rule in ("all", "weighed") or not len(occurring):
        return np.ones(len(counts))
    return np.asarray(occurring.min() / np.maximum(counts, 1)).clip(max=1.0)


def class_weights(rule: str, counts: npt.NDArray[np.int64], balance: float) -> Floats:
    """How much (C,) a selected point of each class counts, from the classes' numbers (C,) of points in the set, which
    has some.

    With rule weighed that is number ** -balance, so at balance 1 every class counts as much as any other, and 1 in the
    mean over all points. With every other rule it is 1.
    """
    if rule != "weighed":
        return np.ones(len(counts))
    weights = np.maximum(counts, 1).astype(np.float64) ** -balance
    return np.asarray(weights * counts.sum() / (weights @ counts))


def hardness_weights(errors: Singles) -> Floats:
    """Weights (n,) of points in the choice within their class, from the summed errors (n,) of the rounds before."""
    return np.minimum(errors.astype(np.float64), 1.0) + FLOOR


def class_totals(labels: Labels, weights: Floats, classes: int) -> Floats:
    """Sums of weights (n,), and numbers, of the points of each class: (2, C). They add up over parts of a batch."""
    own = labels[labels >= 0]
    sums = np.bincount(own, weights[labels >= 0], minlength=classes)
    return np.stack([sums, np.bincount(own, minlength=classes).astype(np.float64)])


def select_points(labels: Labels, shares: Floats, draws: Floats, weights: Floats | None = None) -> Mask:
    """Points (n,) that are selected from labels (n,), -1 for unlabeled, by draws (n,) from 0 to 1.

    shares (C,): chance of a point of each class. weights (n,): factors of these chances, of mean 1 in each class. A
    chance above 1 is 1, so with weights a class that is taken nearly whole gives somewhat fewer points.
    """
    chance = shares[labels]
    if weights is not None:
        chance = chance * weights
    return (labels >= 0) & (draws < chance)


def point_errors(probabilities: Singles, labels: Labels) -> Singles:
    """How wrong (n,) a network's probabilities (n, C) are: 1 minus that of the true class; 0 where unlabeled."""
    labeled = labels >= 0
    true = probabilities[np.arange(len(labels)), np.where(labeled, labels, 0)]
    return np.where(labeled, 1.0 - true, 0.0).astype(np.float32)
