"""A second look: a small network answers for all points, and a large one again for the few that may be an object.

Most points of a picture are easy, and a network of a few hundred weights gets them right. The other points get the
answer of a network that would be too slow for the whole picture. The large network sees these points as a mesh of their
own, in which all other points are off screen.
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
    """Selects the points that get a second look.

    These are the points to which the first network gives one of the `classes` (positions among the outputs) with a
    probability greater than `above`, and all points up to `rings` steps from them. Raises ModelError.
    """

    above: float
    rings: int
    classes: tuple[int, ...]

    def __post_init__(self) -> None:
        if not 0.0 <= self.above < 1.0 or self.rings < 0 or not self.classes:
            raise ModelError(
                "a second look needs `above` from 0 to less than 1, `rings` of at least 0, and at least one class, "
                f"not {self}"
            )

    def selected(self, answers: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """Mask (n + 1,) of the selected points, from the first network's answers (n + 1, C); false off screen.

        A step leads from a point to the points that have it as a neighbor.
        """
        mask = (answers[:, list(self.classes)] > self.above).any(dim=1)
        mask[-1] = False
        for _ in range(self.rings):
            mask = mask | mask[neighbors].any(dim=1)
        return mask


class SecondLook(nn.Module):
    """Two networks for the same classes and mesh: the second one answers for the points that the gate selects.

    Raises ModelError if the networks do not fit each other.
    """

    def __init__(self, first: Network, second: Network, gate: Gate) -> None:
        super().__init__()
        for entry in ("classes", "neighbors"):
            one, other = getattr(first.shape, entry), getattr(second.shape, entry)
            if one != other:
                raise ModelError(
                    f"the first network has {one} {entry}, the one for the second look {other}; they must be equal"
                )
        self.first, self.second, self.gate = first, second, gate

    @property
    def shape(self) -> NetworkShape:
        """The shape of the second network."""
        return self.second.shape

    @property
    def operations(self) -> int:
        """Multiplications and additions of the first network for each point, without those of the second look."""
        return self.first.operations

    def forward(self, points: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """Probabilities (n + 1, C) from points (n + 1, 3) and neighbors (n + 1, N)."""
        answers: torch.Tensor = self.first(points, neighbors)
        kept = self.gate.selected(answers, neighbors).nonzero()[:, 0]
        # The position of each point in the small mesh; its last one, the off-screen point, for all that are not kept.
        position = torch.full((len(points),), len(kept), dtype=torch.int32, device=points.device)
        position[kept] = torch.arange(len(kept), dtype=torch.int32, device=points.device)
        rows = torch.cat([kept, kept.new_tensor([len(points) - 1])])
        again: torch.Tensor = self.second(points[rows], position[neighbors[rows]])
        answers = answers.clone()
        answers[kept] = again[:-1]
        return answers
