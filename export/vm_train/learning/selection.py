"""Point selection: which points of a batch give gradients, and how much each counts (paper, section "Training").

The paper balances the classes by selecting equally many points of each. Its second and third rounds select points by
the errors of the networks before. Weighting instead takes all points and has the same mean gradient with less noise;
benchmarks/experiments/mesh-network.md compares them.

A random number decides whether a point is selected. So the classes are balanced over the whole set and not within each
batch, where the rarest class may have a single point or none.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask, Singles

from ..data.classes import Labels

RULES = ("all", "weighted", "balanced", "hard")
"""all: every labeled point. weighted: every labeled point, but those of frequent classes count less. balanced: as many
points of each class as the rarest object has. hard: balanced, and first the points with large errors of earlier
networks."""

FLOOR = 0.05
"""Weight of a point that no network was wrong about: the paper's "5 % baseline probability"."""


def selection_shares(rule: str, counts: npt.NDArray[np.int64], objects: Mask) -> Floats:
    """Share (C,) of each class's points to select, from the numbers (C,) of points in the set.

    objects (C,): which classes are objects. The rarest object, or without objects the rarest class, decides how many
    points of each class are selected. All points of a still rarer class are selected: it must not limit the others.
    """
    occurring = counts[objects & (counts > 0)] if (objects & (counts > 0)).any() else counts[counts > 0]
    if rule in ("all", "weighted") or not len(occurring):
        return np.ones(len(counts))
    # Section "Training": "selecting an equal number of points from each class".
    return np.asarray(occurring.min() / np.maximum(counts, 1)).clip(max=1.0)


def class_weights(rule: str, counts: npt.NDArray[np.int64], balance: float) -> Floats:
    """Weight (C,) of a selected point of each class, from the numbers (C,) of points in the set, not all 0.

    With rule "weighted", proportional to number ** -balance and 1 in the mean over all points: at balance 1 all classes
    count the same. With every other rule 1.
    """
    if rule != "weighted":
        return np.ones(len(counts))
    weights = np.maximum(counts, 1).astype(np.float64) ** -balance
    return np.asarray(weights * counts.sum() / (weights @ counts))


def hardness_weights(errors: Singles) -> Floats:
    """Relative chance (n,) of each point within its class, from its summed errors (n,) in the rounds before."""
    # Section "Training": "with the probabilities added together with a 5 % baseline probability".
    return np.minimum(errors.astype(np.float64), 1.0) + FLOOR


def class_totals(labels: Labels, weights: Floats, classes: int) -> Floats:
    """Sum of the weights (n,), and number, of the points of each class: (2, C). Totals of parts of a batch add up."""
    own = labels[labels >= 0]
    sums = np.bincount(own, weights[labels >= 0], minlength=classes)
    return np.stack([sums, np.bincount(own, minlength=classes).astype(np.float64)])


def select_points(labels: Labels, shares: Floats, draws: Floats, weights: Floats | None = None) -> Mask:
    """Which points (n,) with labels (n,), -1 for unlabeled, are selected, by random numbers (n,) from 0 to 1.

    shares (C,): chance of a point of each class. weights (n,): factors of these chances, of mean 1 in each class. A
    chance above 1 counts as 1, so with weights a class that is selected nearly whole loses a few points.
    """
    chance = shares[labels]
    if weights is not None:
        chance = chance * weights
    return (labels >= 0) & (draws < chance)


def point_errors(probabilities: Singles, labels: Labels) -> Singles:
    """Error (n,) of a network's probabilities (n, C): 1 minus that of the true class; 0 where unlabeled."""
    labeled = labels >= 0
    true = probabilities[np.arange(len(labels)), np.where(labeled, labels, 0)]
    return np.where(labeled, 1.0 - true, 0.0).astype(np.float32)
