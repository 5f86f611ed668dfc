"""What each point of a mesh sees in torch: its own values and its neighbors', and the way of gradients back.

Half of a training is this gather and its gradient. Torch's own indexing adds gradients one by one; here each point sums
those of the places that saw it, which stand beside each other once they are sorted: four times as fast with four
channels, twice with sixteen, and always in the same order.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch.nn import functional


class Neighborhood:
    """The gather of a mesh's neighbors (n + 1, N): the off-screen point n is linked to itself."""

    def __init__(self, neighbors: torch.Tensor) -> None:
        own = torch.arange(len(neighbors), dtype=torch.int32, device=neighbors.device)
        self.places = torch.cat([own[:, None], neighbors.to(torch.int32)], dim=1)
        self._seen_by: tuple[torch.Tensor, torch.Tensor] | None = None

    def gather(self, x: torch.Tensor) -> torch.Tensor:
        """(n + 1, N + 1, C): of each point its own row of x (n + 1, C), then its neighbors'."""
        gathered: torch.Tensor = _Gather.apply(x, self)  # type: ignore[no-untyped-call]
        return gathered

    @property
    def seen_by(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Where the points stand in the flattened places: positions, ordered by point, and where each point's begin."""
        if self._seen_by is None:
            flat = self.places.flatten()
            # numpy sorts whole numbers several times faster, but only in the processor's memory.
            order = torch.from_numpy(np.argsort(flat.cpu().numpy(), kind="stable").astype(np.int32)).to(flat.device)
            ends = torch.bincount(flat, minlength=len(self.places)).cumsum(0)
            starts = torch.cat([ends.new_zeros(1), ends[:-1]]).to(torch.int32)
            self._seen_by = order, starts
        return self._seen_by


class _Gather(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: torch.Tensor, neighborhood: Neighborhood) -> torch.Tensor:
        ctx.neighborhood = neighborhood
        return functional.embedding(neighborhood.places, x)

    @staticmethod
    def backward(ctx: Any, gradient: torch.Tensor) -> tuple[torch.Tensor, None]:
        order, starts = ctx.neighborhood.seen_by
        rows = gradient.reshape(-1, gradient.shape[-1])
        return functional.embedding_bag(order, rows, starts, mode="sum"), None
