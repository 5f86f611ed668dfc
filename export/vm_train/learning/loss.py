"""The loss of single points. The paper names none (section "Training")."""

from __future__ import annotations

import torch
from torch.nn import functional

from .recipe import Recipe


def point_losses(logits: torch.Tensor, labels: torch.Tensor, recipe: Recipe) -> torch.Tensor:
    """Loss (n,) of each point, from logits (n, C) and labels (n,); 0 for label -1.

    With recipe.loss "focal" (T. Lin and others, 2017), points that the network is sure of count less.
    """
    losses = functional.cross_entropy(logits.float(), labels, ignore_index=-1, reduction="none")
    if recipe.loss == "focal":
        # 1 - probability of the truth. Not 0: there a power below 1 has an infinite gradient.
        losses = (-torch.expm1(-losses)).clamp(min=1e-7) ** recipe.gamma * losses
    return losses
