"""A network that teaches its answers to another one (knowledge distillation, G. Hinton and others, 2015)."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from vm_export.look_network import LookNetwork


@dataclass(frozen=True, eq=False)
class LookTeacher:
    """A trained network. shares (n,): for each training patch, the share of its target that comes from the network."""

    network: LookNetwork
    shares: torch.Tensor

    @torch.no_grad()
    def presence(
        self, chosen: torch.Tensor, patches: torch.Tensor, kinds: torch.Tensor, shown: torch.Tensor
    ) -> torch.Tensor:
        """The targets (k,) for training patches with these positions (k,), after augmentation: (k, size, size, 3).

        kinds (k,): number of the class of each. shown (k,): whether each shows an object, 1 or 0.
        """
        shares = self.shares[chosen]
        taught = torch.flatten(shares.nonzero())
        wanted = shown.clone()
        answers = torch.sigmoid(self.network.logits(patches[taught])[torch.arange(len(taught)), kinds[taught], 0])
        wanted[taught] = torch.lerp(shown[taught], answers, shares[taught])
        return wanted
