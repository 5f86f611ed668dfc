"""Training a network: batches in, weights out, the same weights whether it was interrupted or not.

What a step does depends on nothing but the seed, its number and the weights before it, so a training goes on from its
last state as if it had never stopped. With several processes (torch.distributed) each takes its part of every batch,
and gradients are averaged over the selected points of all parts.
"""

from __future__ import annotations

import io
import math
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch import distributed, nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from vm_embedded.arrays import Floats, Singles
from vm_embedded.errors import InputError, one_line
from vm_embedded.files import atomic_write
from vm_export.network import Network

from ..graphs.labeled_graph import LabeledGraph, join_graphs
from ..graphs.schedule import Item
from .optimizer import ScheduledOptimizer
from .recipe import Recipe
from .selection import class_totals, hardness_weights, point_errors, select_points
from .targets import targets


@dataclass(frozen=True)
class Step:
    """What one step did: its number, the mean loss of the points that gave gradients, how many, and the rate."""

    number: int
    loss: float
    points: int
    rate: float


class Trainer:
    """A network while it is trained for `total` steps.

    shares (C,): chance of each class's points to give gradients. weights (C,): how much each then counts. graders:
    networks of earlier rounds; points that they were wrong about are selected rather than others of their class.
    teacher: whose answers are learned beside the labels. device: where torch computes, "cpu" or "cuda".
    """

    def __init__(
        self,
        network: Network,
        recipe: Recipe,
        total: int,
        shares: Floats,
        weights: Floats,
        graders: Sequence[Network] = (),
        teacher: nn.Module | None = None,
        device: str = "cpu",
    ) -> None:
        self.network = network.to(device).train()
        self.recipe, self.total, self.done = recipe, total, 0
        self._shares, self._device = shares, device
        self._weights = torch.from_numpy(weights.astype(np.float32)).to(device)
        self._graders = [each.to(device).eval() for each in graders]
        self._teacher = None if teacher is None else teacher.to(device).eval()
        self._optimizer = ScheduledOptimizer(self.network, recipe, total)
        self._average = _average_of(self.network, recipe.averaging) if recipe.averaging else None

    @property
    def result(self) -> Network:
        """The network that answers: with averaged weights, if they are."""
        return self.network if self._average is None else cast(Network, self._average.module)

    def set_rate(self, rate: float) -> None:
        """The learning rate of the next step, where the schedule is constant."""
        self._optimizer.rate = rate

    def step(self, items: Sequence[Item], graphs: Sequence[LabeledGraph]) -> Step:
        """Learn from the graphs of this process's part of a batch. Raises InputError if the loss is no number."""
        rate = self._optimizer.rate
        loss, weight, points = self._loss(items, graphs)
        weights = float(sum_over_processes(torch.tensor(weight))) or 1.0
        mean = float(sum_over_processes(loss.detach().cpu())) / weights
        if not math.isfinite(mean):
            raise InputError(f"the loss of step {self.done + 1} is no number: begin again with a lower training.rate")
        self._optimizer.zero_grad()
        if points:
            (loss / weights).backward()  # type: ignore[no-untyped-call]
        _sum_gradients(self.network)
        if self.recipe.clip:
            nn.utils.clip_grad_norm_(self.network.parameters(), self.recipe.clip)
        self._optimizer.step()
        if self._average is not None:
            self._average.update_parameters(self.network)
        self.done += 1
        return Step(self.done, mean, int(sum_over_processes(torch.tensor(points))), rate)

    def _loss(self, items: Sequence[Item], graphs: Sequence[LabeledGraph]) -> tuple[torch.Tensor, float, int]:
        """The weighed sum of losses of the selected points of some pictures, their summed weight and their number."""
        classes = self.network.shape.classes
        if not graphs:  # of a small batch other processes have all; they wait for the totals
            if self._graders:
                sum_over_processes(torch.zeros((2, classes), dtype=torch.float64))
            return torch.zeros(()), 0.0, 0
        graph, _ = join_graphs(graphs)
        points = torch.from_numpy(graph.points).to(self._device)
        neighbors = torch.from_numpy(graph.neighbors).to(self._device)
        draws = [
            np.random.default_rng([2, *(item.seed or ())]).random(len(each))
            for item, each in zip(items, graphs, strict=True)
        ]
        chances = self._chances(points, neighbors, graph) if self._graders else None
        chosen = select_points(graph.labels, self._shares, np.concatenate(draws), chances)
        with torch.autocast(torch.device(self._device).type, torch.bfloat16, enabled=self.recipe.precision == "mixed"):
            logits = self.network.logits(points, neighbors)
        labels = torch.from_numpy(np.where(chosen, graph.labels, -1).astype(np.int64)).to(self._device)
        single = nn.functional.cross_entropy(
            logits[:-1].float(), self._targets(graph, points, neighbors, labels), ignore_index=-1, reduction="none"
        )
        if self.recipe.loss == "focal":
            # Not 0, where the gradient of a power below 1 is none.
            single = (-torch.expm1(-single)).clamp(min=1e-7) ** self.recipe.gamma * single
        weights = torch.where(labels >= 0, self._weights[labels], 0.0)
        return single @ weights, float(weights.sum()), int(chosen.sum())

    @torch.no_grad()
    def _targets(
        self, graph: LabeledGraph, points: torch.Tensor, neighbors: torch.Tensor, chosen: torch.Tensor
    ) -> torch.Tensor:
        """What the selected points are to answer: their labels (n,), or probabilities (n, C)."""
        recipe = self.recipe
        if self._teacher is None and not recipe.smoothing:
            return chosen
        labels = torch.from_numpy(graph.labels.astype(np.int64)).to(self._device)
        taught = None if self._teacher is None else self._teacher(points, neighbors)[:-1]
        return targets(labels, self.network.shape.classes, neighbors, recipe.smoothing, taught, recipe.distillation)

    @torch.no_grad()
    def _chances(self, points: torch.Tensor, neighbors: torch.Tensor, graph: LabeledGraph) -> Floats:
        """How much rather than others of their class the points (n,) are selected: 1 in the mean of each class."""
        errors = np.zeros(len(graph), dtype=np.float32)
        for grader in self._graders:
            errors += point_errors(grader(points, neighbors)[:-1].cpu().numpy(), graph.labels)
        weights = hardness_weights(errors)
        sums, counts = sum_over_processes(
            torch.from_numpy(class_totals(graph.labels, weights, len(self._shares)))
        ).numpy()
        means = np.divide(sums, counts, out=np.ones_like(sums), where=counts > 0)
        return np.asarray(weights / means[graph.labels])

    @torch.no_grad()
    def probabilities(self, graph: LabeledGraph) -> Singles:
        """The network's answers (n, C)."""
        points, neighbors = torch.from_numpy(graph.points), torch.tensor(graph.neighbors)
        answers: Singles = self.result(points.to(self._device), neighbors.to(self._device))[:-1].cpu().numpy()
        return answers

    def save(self, path: Path, more: Mapping[str, Any]) -> None:
        """Write all that going on needs, and `more` plain values. Raises InputError if it can't be written."""
        state = {
            "done": self.done,
            "network": self.network.state_dict(),
            "average": None if self._average is None else self._average.state_dict(),
            "descent": self._optimizer.state_dict(),
            "more": dict(more),
        }
        content = io.BytesIO()  # on a full disk torch would fail in its own way
        torch.save(state, content)
        with atomic_write(path) as part:
            part.write_bytes(content.getbuffer())

    def load(self, state: Mapping[str, Any]) -> None:
        """Go on from a state that `read_state` read. Raises InputError if it is of another training."""
        try:
            self.network.load_state_dict(state["network"])
            self._optimizer.load_state_dict(state["descent"])
            if self._average is not None:
                self._average.load_state_dict(state["average"])
            self.done = int(state["done"])
        except (RuntimeError, KeyError, ValueError, TypeError) as error:
            raise InputError(f"the state is of another training: {one_line(error)}") from error


def read_state(path: Path) -> dict[str, Any]:
    """What `Trainer.save` wrote; nothing in it is executed. Raises InputError."""
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, KeyError, ValueError, EOFError, pickle.UnpicklingError) as error:
        raise InputError(
            f"can't go on from {path}, it is damaged: {one_line(error)}; begin again in a new folder"
        ) from error
    if not isinstance(state, dict) or not isinstance(state.get("more"), dict):
        raise InputError(f"can't go on from {path}: it is no state of a training")
    return state


def sum_over_processes(value: torch.Tensor) -> torch.Tensor:
    """The sum over all processes, as every one of them gets it."""
    if not distributed.is_initialized():
        return value
    total = value.to(_meeting_place())
    distributed.all_reduce(total)
    return total.cpu()


def _meeting_place() -> str:
    """Device of tensors that processes exchange: nccl has only GPUs."""
    return "cuda" if distributed.get_backend() == "nccl" else "cpu"


def _average_of(network: Network, decay: float) -> AveragedModel:
    """A copy of a network whose weights become the mean of those it is given, older ones fading by `decay` a step."""
    fading = get_ema_multi_avg_fn(decay)  # type: ignore[no-untyped-call]
    return AveragedModel(network, multi_avg_fn=fading)


def _sum_gradients(network: nn.Module) -> None:
    """Every process gets the sum of all gradients."""
    if distributed.is_initialized():
        for each in network.parameters():
            each.grad = torch.zeros_like(each) if each.grad is None else each.grad
            distributed.all_reduce(each.grad)
