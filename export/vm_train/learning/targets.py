"""What a network is to answer for each point: its label, softened where it says less than it seems.

At an outline a point sees both sides, so its label may lean on those of its neighbors (label smoothing, at silhouettes
only). And a larger network that is already trained knows which points are easily mistaken: its answers say more than
labels do (knowledge distillation, G. Hinton and others, 2015).
"""

from __future__ import annotations

import torch
from torch.nn import functional


def targets(
    labels: torch.Tensor,
    classes: int,
    neighbors: torch.Tensor,
    smoothing: float,
    taught: torch.Tensor | None = None,
    share: float = 0.0,
) -> torch.Tensor:
    """Probabilities (n, C) to answer, of points with labels (n,), -1 for unlabeled ones, and neighbors (n + 1, N).

    smoothing: share of a point's label that its labeled neighbors have together. taught (n, C): a teacher's answers,
    and what `share` of the target they are. What is given for unlabeled points means nothing.
    """
    own = functional.one_hot(labels.clamp(min=0), classes).float() * (labels >= 0)[:, None]
    if smoothing:
        around = torch.cat([own, own.new_zeros(1, classes)])[neighbors[:-1].long()].sum(dim=1)
        counted = around.sum(dim=1, keepdim=True)
        own = torch.where(counted > 0, torch.lerp(own, around / counted.clamp(min=1), smoothing), own)
    return own if taught is None else torch.lerp(own, taught, share)
