"""A second look: a large network for the few points that a small one does not take for lawn.

Most points of a picture are easy, and a network of a few hundred weights knows it of them. What it is not sure of gets
the answer of a network that would be too slow for the whole picture. That network sees the points that are worth it as
a mesh of their own, in which all others are off screen.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn

from vm_embedded.errors import ModelError

from .network import Network
from .network_shape import NetworkShape


@dataclass(frozen=True)
class Gate:
    """What is worth a second look: points that the first network gives one of the `classes` (positions of outputs) with
    a probability above `above`, and all up to `rings` steps from them.

    Raises ModelError.
    """

    above: float
    rings: int
    classes: tuple[int, ...]

    def __post_init__(self) -> None:
        if not 0.0 <= self.above < 1.0 or self.rings < 0 or not self.classes:
            raise ModelError(f"a second look needs a class, a probability from 0 to 1, and steps from 0, not {self}")

    def passed(self, answers: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """Which points (n + 1,) are worth it, by the first network's answers (n + 1, C); the off-screen point is not.

        A step is from a point to one whose neighbor it is.
        """
        worth = (answers[:, list(self.classes)] > self.above).any(dim=1)
        worth[-1] = False
        for _ in range(self.rings):
            worth = worth | worth[neighbors].any(dim=1)
        return worth


class SecondLook(nn.Module):
    """Two networks for the same classes and mesh, the second for what passes the gate.

    Raises ModelError if the networks don't fit each other.
    """

    def __init__(self, first: Network, second: Network, gate: Gate) -> None:
        super().__init__()
        for what in ("classes", "neighbors"):
            one, other = getattr(first.shape, what), getattr(second.shape, what)
            if one != other:
                raise ModelError(f"the first network has {one} {what}, the one for the second look {other}")
        self.first, self.second, self.gate = first, second, gate

    @property
    def shape(self) -> NetworkShape:
        """Of the network for the second look."""
        return self.second.shape

    @property
    def operations(self) -> int:
        """Multiplications and additions for each point of the picture; those of the second look come on top."""
        return self.first.operations

    def forward(self, points: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """Probabilities (n + 1, C) from points (n + 1, 3) and neighbors (n + 1, N)."""
        answers: torch.Tensor = self.first(points, neighbors)
        kept = self.gate.passed(answers, neighbors).nonzero()[:, 0]
        position = torch.full((len(points),), len(kept), dtype=torch.int32, device=points.device)
        position[kept] = torch.arange(len(kept), dtype=torch.int32, device=points.device)
        rows = torch.cat([kept, kept.new_tensor([len(points) - 1])])
        again: torch.Tensor = self.second(points[rows], position[neighbors[rows]])
        answers = answers.clone()
        answers[kept] = again[:-1]
        return answers
