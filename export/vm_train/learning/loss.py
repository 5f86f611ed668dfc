"""The losses of points, of which the paper names none (section "Training"), and of peaks: of scores, the focal loss of
center networks (X. Zhou and others, 2019, "Objects as Points")."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch.nn import functional

from vm_embedded.network.manifest import PEAK_OUTPUTS

from ..graphs.labeled_graph import LabeledGraph
from ..graphs.peak_targets import PeakTargets, peak_targets
from .configuration import Recipe

_SHARE, _WAY_SHARE = 0.1, 0.5
"""Weights of the losses of scores and ways, beside 1 for the loss of points."""

_BEND = 0.3
"""Error of a way from which it counts by its size, and no longer by its square [cells]."""


def point_losses(logits: torch.Tensor, labels: torch.Tensor, recipe: Recipe) -> torch.Tensor:
    """Loss (n,) of each point, from logits (n, C) and labels (n,); 0 for label -1.

    With recipe.loss "focal" (T. Lin and others, 2017), points that the network is sure of count less.
    """
    losses = functional.cross_entropy(logits.float(), labels, ignore_index=-1, reduction="none")
    if recipe.loss == "focal":
        # 1 - probability of the truth. Not 0: there a power below 1 has an infinite gradient.
        losses = (-torch.expm1(-losses)).clamp(min=1e-7) ** recipe.gamma * losses
    return losses


def targets_of(graphs: Sequence[LabeledGraph], classes: Sequence[int]) -> PeakTargets:
    """The targets of all points of some graphs, one graph after the other. classes: numbers of those with peaks."""
    found = []
    for each in graphs:
        assert each.cells is not None
        assert each.objects is not None
        found.append(peak_targets(each.cells, each.labels, each.objects, classes))
    return PeakTargets(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def peak_losses(outputs: torch.Tensor, targets: PeakTargets) -> tuple[torch.Tensor, torch.Tensor]:
    """Sums (2,) of the weighted losses of scores and ways, and what to divide them by (2,): objects, and ways.

    outputs (n, 4 P): of the network, as the manifest describes them.
    """
    score, counts, way, near = (torch.from_numpy(each).to(outputs.device) for each in targets)
    found = outputs.float().reshape(len(outputs), -1, PEAK_OUTPUTS)
    logits = found[..., 0]
    chance, own = logits.sigmoid(), (score == 1.0) & counts
    misses = (1.0 - chance) ** 2 * functional.logsigmoid(logits)
    false = (1.0 - score) ** 4 * chance**2 * functional.logsigmoid(-logits)
    scores = -misses[own].sum() - false[counts & ~own].sum()
    ways = functional.smooth_l1_loss(found[..., 1:][near], way[near], reduction="sum", beta=_BEND)
    losses = torch.stack([_SHARE * scores, _WAY_SHARE * ways])
    return losses, torch.stack([own.sum(), near.sum()]).to(torch.float32).cpu()
