"""Trains a network step by step, and saves and loads the state between two steps.

A step depends only on the seed, its number and the state before it: the weights and the state of the optimizer. With
one computing thread on a CPU, a training that resumes from its last state therefore ends with the weights of one that
nobody interrupted. With several processes (torch.distributed), each takes its part of every batch, and the gradient is
that of the mean loss over the selected points of all parts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import distributed, nn

from vm_embedded.arrays import Floats, Singles
from vm_embedded.errors import InputError, one_line
from vm_export.mesh_networks import MeshNetwork
from vm_export.torch_files import load_values, save_values

from ..graphs.labeled_graph import LabeledGraph, join_graphs
from ..graphs.schedule import Item
from .loss import peak_losses, point_losses, targets_of
from .optimizer import ScheduledOptimizer
from .recipe import Recipe
from .selection import class_totals, hardness_weights, point_errors, select_points

_DRAWS = 2
"""Keeps the random numbers of the selection apart from others with the seed of the same item."""


class DivergedError(InputError):
    """The loss became NaN or infinite: to repeat the same steps would not help."""


@dataclass(frozen=True)
class StepResult:
    """A step's number, from 1, the mean loss of its selected points, their number, and the learning rate."""

    number: int
    loss: float
    points: int
    rate: float


@dataclass(frozen=True)
class _BatchLoss:
    """Sums over this process's part of a batch.

    losses (3,): of the selected points, of the scores of peaks, and of their ways. weights (3,): what they are divided
    by. points: number of selected points.
    """

    losses: torch.Tensor
    weights: torch.Tensor
    points: int


class Trainer:
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
        self.network = network.to(device).train()
        self.recipe, self.total, self.done = recipe, total, 0
        self._shares, self._device, self._peaks = shares, device, tuple(peaks)
        self._weights = torch.from_numpy(weights.astype(np.float32)).to(device)
        self._graders = [each.to(device).eval() for each in graders]
        self._optimizer = ScheduledOptimizer(self.network, recipe, total)

    def set_rate(self, rate: float) -> None:
        """Set the learning rate of the next step. Any schedule but a constant one replaces it after that step."""
        self._optimizer.rate = rate

    def step(self, items: Sequence[Item], graphs: Sequence[LabeledGraph]) -> StepResult:
        """Learn from this process's part of a batch. Raises DivergedError if the loss is NaN or infinite."""
        rate = self._optimizer.rate
        part = self._batch_loss(items, graphs)
        weights = sum_over_processes(part.weights)
        weights = torch.where(weights > 0.0, weights, 1.0)
        mean = float((sum_over_processes(part.losses.detach().cpu()) / weights).sum())
        if not math.isfinite(mean):
            raise DivergedError(
                f"the loss of step {self.done + 1} is NaN or infinite: begin again with a lower training.rate"
            )
        self._optimizer.zero_grad()
        if part.points:
            (part.losses / weights.to(part.losses.device)).sum().backward()  # type: ignore[no-untyped-call]
        _sum_gradients(self.network)
        if self.recipe.clip:
            nn.utils.clip_grad_norm_(self.network.parameters(), self.recipe.clip)
        self._optimizer.step()
        self.done += 1
        return StepResult(self.done, mean, int(sum_over_processes(torch.tensor(part.points))), rate)

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

    def save(self, path: Path, more: Mapping[str, Any]) -> None:
        """Write the state to resume from, with `more` plain values. Raises InputError if it can't be written."""
        state = {
            "done": self.done,
            "network": self.network.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "more": dict(more),
        }
        save_values(path, state)

    def load(self, state: Mapping[str, Any]) -> None:
        """Resume from a state that `read_state` read. Raises InputError if it belongs to another training."""
        try:
            self.network.load_state_dict(state["network"])
            self._optimizer.load_state_dict(state["optimizer"])
            self.done = int(state["done"])
        except (RuntimeError, KeyError, ValueError, TypeError) as error:
            raise InputError(f"the state belongs to another training: {one_line(error)}") from error


def read_state(path: Path) -> dict[str, Any]:
    """Read the file of `Trainer.save` without executing anything in it. Raises InputError."""
    try:
        state = load_values(path, "the state of a training")
    except InputError as error:
        raise InputError(f"can't resume: {error}; begin again in a new folder") from error
    if not isinstance(state, dict) or not isinstance(state.get("more"), dict):
        raise InputError(f"can't resume from {path}: it is not the state of a training; begin again in a new folder")
    return state


def sum_over_processes(value: torch.Tensor) -> torch.Tensor:
    """The sum of all processes' values, on the CPU; every process gets it."""
    if not distributed.is_initialized():
        return value
    total = value.to("cuda" if distributed.get_backend() == "nccl" else "cpu")  # nccl sends tensors of GPUs only
    distributed.all_reduce(total)
    return total.cpu()


def _draws(items: Sequence[Item], graphs: Sequence[LabeledGraph]) -> Floats:
    """A random number from 0 to 1 for each point of a batch, decided by the seeds of its items."""
    return np.concatenate(
        [
            np.random.default_rng([_DRAWS, *(item.seed or ())]).random(len(each))
            for item, each in zip(items, graphs, strict=True)
        ]
    )


def _sum_gradients(network: nn.Module) -> None:
    """Give every process the sum of all processes' gradients."""
    if distributed.is_initialized():
        for each in network.parameters():
            each.grad = torch.zeros_like(each) if each.grad is None else each.grad
            distributed.all_reduce(each.grad)
