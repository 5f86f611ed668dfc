"""The loss of single points, and the probabilities that they should have.

A point at an outline shows both sides, so its label may lean on its neighbors' labels (label smoothing at outlines
only). A larger, trained network knows which points are easily mistaken; its probabilities say more than labels
(knowledge distillation, G. Hinton and others, 2015).

The paper names no loss (section "Training").
"""

from __future__ import annotations

import torch
from torch.nn import functional

from .recipe import Recipe


def point_losses(logits: torch.Tensor, targets: torch.Tensor, recipe: Recipe) -> torch.Tensor:
    """Loss (n,) of each point, from logits (n, C) and targets: labels (n,), -1 for 0 loss, or probabilities (n, C).

    With recipe.loss "focal" (T. Lin and others, 2017), points that the network is sure of count less.
    """
    losses = functional.cross_entropy(logits.float(), targets, ignore_index=-1, reduction="none")
    if recipe.loss == "focal":
        # 1 - probability of the truth. Not 0: there a power below 1 has an infinite gradient.
        losses = (-torch.expm1(-losses)).clamp(min=1e-7) ** recipe.gamma * losses
    return losses


def soft_targets(
    labels: torch.Tensor,
    classes: int,
    neighbors: torch.Tensor,
    smoothing: float,
    taught: torch.Tensor | None = None,
    share: float = 0.0,
) -> torch.Tensor:
    """Target probabilities (n, C) of points with labels (n,), -1 for unlabeled ones, and neighbors (n + 1, N).

    smoothing: share of the target that the labels of a point's labeled neighbors have together. taught (n, C): the
    teacher's probabilities. share: their share of the target. Rows of unlabeled points have no meaning.
    """
    own = functional.one_hot(labels.clamp(min=0), classes).float() * (labels >= 0)[:, None]
    if smoothing:
        around = torch.cat([own, own.new_zeros(1, classes)])[neighbors[:-1].long()].sum(dim=1)
        counted = around.sum(dim=1, keepdim=True)
        own = torch.where(counted > 0, torch.lerp(own, around / counted.clamp(min=1), smoothing), own)
    return own if taught is None else torch.lerp(own, taught, share)
