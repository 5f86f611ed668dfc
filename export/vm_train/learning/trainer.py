"""Trains a mesh network step by step.

With several processes (torch.distributed), each takes its part of every batch, and the gradient is that of the mean
loss over the selected points of all parts.

The paper names no loss of points (section "Training"); that of peaks is the focal loss of center networks (X. Zhou and
others, 2019, "Objects as Points").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional

from vm_embedded.arrays import Floats, Singles
from vm_embedded.network.manifest import PEAK_OUTPUTS
from vm_export.mesh_networks import MeshNetwork

from ..graphs.labeled_graph import LabeledGraph, join_graphs
from ..graphs.peak_targets import PeakTargets, peak_targets
from ..graphs.schedule import Item
from ..runs.hardware import sum_over_processes
from ..runs.learner import Learner
from ..runs.optimizer import ScheduledOptimizer
from .configuration import Recipe
from .selection import class_totals, hardness_weights, point_errors, select_points

_DRAWS = 2
"""Keeps the random numbers of the selection apart from others with the seed of the same item."""


@dataclass(frozen=True)
class _BatchLoss:
    """Sums over this process's part of a batch.

    losses (3,): of the selected points, of the scores of peaks, and of their ways. weights (3,): what they are divided
    by. points: number of selected points.
    """

    losses: torch.Tensor
    weights: torch.Tensor
    points: int


class Trainer(Learner[MeshNetwork]):
    """A network that is trained for `total` steps.

    shares (C,): chance that a point of each class is selected. weights (C,): weight of a selected point in the loss.
    graders: networks of earlier rounds; a point is more likely to be selected if they were wrong about it. device:
    "cpu" or "cuda", as torch names it. peaks: numbers of the classes with peaks.
    """

    def __init__(
        self,
        network: MeshNetwork,
        recipe: Recipe,
        total: int,
        shares: Floats,
        weights: Floats,
        graders: Sequence[MeshNetwork] = (),
        device: str = "cpu",
        peaks: Sequence[int] = (),
    ) -> None:
        network = network.to(device).train()
        optimizer = ScheduledOptimizer(network, recipe.optimizer, recipe.rate, recipe.decay, total, recipe.schedule)
        super().__init__(network, optimizer, total, device)
        self.recipe, self._shares, self._peaks = recipe, shares, tuple(peaks)
        self._weights = torch.from_numpy(weights.astype(np.float32)).to(device)
        self._graders = [each.to(device).eval() for each in graders]

    def step(self, items: Sequence[Item], graphs: Sequence[LabeledGraph]) -> dict[str, float]:
        """Learn from this process's part of a batch. Raises DivergedError if the loss is NaN or infinite.

        Returns the mean loss of the selected points, their number, and the learning rate.
        """
        rate, part = self.rate, self._batch_loss(items, graphs)
        weights = sum_over_processes(part.weights)
        weights = torch.where(weights > 0.0, weights, 1.0)
        mean = float((sum_over_processes(part.losses.detach().cpu()) / weights).sum())
        loss = (part.losses / weights.to(part.losses.device)).sum() if part.points else None
        self.learn(mean, loss, self.recipe.clip)
        points = int(sum_over_processes(torch.tensor(part.points)))
        return {"loss": mean, "points": points, "rate": rate}

    def _batch_loss(self, items: Sequence[Item], graphs: Sequence[LabeledGraph]) -> _BatchLoss:
        if not any(map(len, graphs)):  # a small batch may leave this process nothing, and a camera may see nothing
            if self._graders:  # the other processes wait for its part of the sum in _chance_factors
                sum_over_processes(torch.zeros((2, self.network.shape.classes), dtype=torch.float64))
            return _BatchLoss(torch.zeros(3), torch.zeros(3), 0)
        graph, _ = join_graphs(graphs)
        points = torch.from_numpy(graph.points).to(self._device)
        around = torch.from_numpy(graph.around).to(self._device)
        # Section "Training" of the paper: gradients come from the selected points only; the others get label -1.
        factors = self._chance_factors(points, around, graph) if self._graders else None
        chosen = select_points(graph.labels, self._shares, _draws(items, graphs), factors)
        labels = torch.from_numpy(np.where(chosen, graph.labels, -1).astype(np.int64)).to(self._device)
        with torch.autocast(torch.device(self._device).type, torch.bfloat16, enabled=self.recipe.precision == "mixed"):
            logits = self.network.logits(points, around)[:-1]  # without the off-screen point, the last one
        classes = self.network.shape.classes
        losses = point_losses(logits[:, :classes], labels, self.recipe)
        weights = torch.where(labels >= 0, self._weights[labels], 0.0)
        peaks, ways = torch.zeros(2, device=losses.device), torch.zeros(2)
        if self._peaks:
            peaks, ways = peak_losses(logits[:, classes:], targets_of(graphs, self._peaks))
        sums = torch.cat([(losses @ weights)[None], peaks])
        return _BatchLoss(sums, torch.cat([weights.sum()[None].cpu(), ways]), int(chosen.sum()))

    @torch.no_grad()
    def _chance_factors(self, points: torch.Tensor, around: torch.Tensor, graph: LabeledGraph) -> Floats:
        """Factors (n,) of the points' chances to be selected, from the graders' errors; mean 1 in each class."""
        errors = np.zeros(len(graph), dtype=np.float32)
        for grader in self._graders:
            errors += point_errors(grader.probabilities(points, around)[:-1].cpu().numpy(), graph.labels)
        weights = hardness_weights(errors)
        totals = torch.from_numpy(class_totals(graph.labels, weights, len(self._shares)))
        sums, counts = sum_over_processes(totals).numpy()
        means = np.divide(sums, counts, out=np.ones_like(sums), where=counts > 0)
        return np.asarray(weights / means[graph.labels])

    @torch.no_grad()
    def probabilities(self, graph: LabeledGraph) -> Singles:
        """Probabilities (n, C) that the network gives the points of a graph."""
        # torch.tensor copies the neighbors: those of a mesh are read-only, and torch.from_numpy warns about that.
        points, around = torch.from_numpy(graph.points), torch.tensor(graph.around)
        self.network.eval()
        answer = self.network.probabilities(points.to(self._device), around.to(self._device))
        self.network.train()
        answers: Singles = answer[:-1].cpu().numpy()
        return answers


def _draws(items: Sequence[Item], graphs: Sequence[LabeledGraph]) -> Floats:
    """A random number from 0 to 1 for each point of a batch, decided by the seeds of its items."""
    return np.concatenate(
        [
            np.random.default_rng([_DRAWS, *(item.seed or ())]).random(len(each))
            for item, each in zip(items, graphs, strict=True)
        ]
    )


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
