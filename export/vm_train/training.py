"""Training: batches in, checkpoints out, the same weights whether it was interrupted or not.

What a step does depends on nothing but the seed, its number and the weights before it, so a run goes on from its last
state as if it had never stopped. With several processes (torch.distributed) each takes its part of every batch, and
gradients are averaged over the selected points of all parts.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import distributed, nn

from vm_embedded.errors import InputError, one_line, unknown
from vm_embedded.files import written_beside
from vm_export.network import Network

from .graphs import Graph, together
from .selection import selected

OPTIMIZERS: dict[str, Callable[..., torch.optim.Optimizer]] = {
    "adamw": torch.optim.AdamW,
    "adam": torch.optim.Adam,
    "sgd": torch.optim.SGD,
}
LOSSES = ("cross_entropy", "focal")
SCHEDULES = ("one_cycle", "constant")


@dataclass(frozen=True)
class Recipe:
    """How a network is trained. rate: the highest learning rate. gamma: of the focal loss. Raises InputError."""

    epochs: int = 20
    batch: int = 8
    rate: float = 8e-3
    optimizer: str = "adamw"
    schedule: str = "one_cycle"
    decay: float = 1e-4
    clip: float = 1.0
    loss: str = "cross_entropy"
    gamma: float = 2.0
    selection: str = "balanced"
    seed: int = 0

    def __post_init__(self) -> None:
        for what, value, allowed in (
            ("optimizer", self.optimizer, OPTIMIZERS),
            ("schedule", self.schedule, SCHEDULES),
            ("loss", self.loss, LOSSES),
        ):
            if value not in allowed:
                raise InputError(unknown(what, value, allowed))
        if min(self.epochs, self.batch) < 1 or not self.rate > 0.0:
            raise InputError("epochs and batch must be at least 1, and the rate above 0")


@dataclass(frozen=True)
class Step:
    """What one step did: its number, the loss, and how many points gave it."""

    number: int
    loss: float
    points: int


@dataclass(frozen=True)
class Item:
    """A picture to be loaded: its position in the set, and the epoch, which seeds its augmentation."""

    position: int
    epoch: int


def plan(recipe: Recipe, count: int) -> Iterator[list[Item]]:
    """The batches of all steps of a training on `count` pictures; an epoch's last batch may be smaller."""
    for epoch in range(recipe.epochs):
        shuffled = np.random.default_rng([recipe.seed, 1, epoch]).permutation(count)
        for start in range(0, count, recipe.batch):
            yield [Item(int(each), epoch) for each in shuffled[start : start + recipe.batch]]


Loader = Callable[[list[list[Item]]], Iterable[list[Graph]]]
"""Gives the graphs of batches, in order; see loading.py."""


class Training:
    """A network while it is trained on `count` pictures.

    errors: for selection hard, how wrong earlier networks were at each point of a picture, by its position.
    """

    def __init__(
        self,
        network: Network,
        recipe: Recipe,
        count: int,
        errors: Callable[[int], np.ndarray] | None = None,
    ) -> None:
        if count < 1:
            raise InputError("there are no pictures to train on")
        self.network, self.recipe = network, recipe
        self._count, self._errors = count, errors
        self.steps_an_epoch = -(-count // recipe.batch)
        self.total = recipe.epochs * self.steps_an_epoch
        options = {} if recipe.optimizer == "sgd" else {"weight_decay": recipe.decay}
        self._optimizer = OPTIMIZERS[recipe.optimizer](network.parameters(), lr=recipe.rate, **options)
        self._schedule: torch.optim.lr_scheduler.LRScheduler
        if recipe.schedule == "one_cycle":
            self._schedule = torch.optim.lr_scheduler.OneCycleLR(self._optimizer, recipe.rate, total_steps=self.total)
        else:
            self._schedule = torch.optim.lr_scheduler.ConstantLR(self._optimizer, factor=1.0, total_iters=0)
        self.done = 0

    def run(self, loader: Loader, until: int | None = None) -> Iterator[Step]:
        """Do the steps that are left, or those before `until`, and report each."""
        rank, size = (distributed.get_rank(), distributed.get_world_size()) if distributed.is_initialized() else (0, 1)
        batches = list(plan(self.recipe, self._count))[self.done : until]
        own = [batch[rank::size] for batch in batches]
        for items, graphs in zip(own, loader(own), strict=True):
            yield self._step(items, graphs)

    def _step(self, items: list[Item], graphs: list[Graph]) -> Step:
        loss, points = self._loss(items, graphs) if graphs else (torch.zeros(()), 0)
        self._optimizer.zero_grad()
        everyone = _sum_over_processes(torch.tensor(float(points))).clamp(min=1.0)
        if points:
            (loss / everyone).backward()  # type: ignore[no-untyped-call]
        _sum_gradients(self.network)
        if self.recipe.clip:
            nn.utils.clip_grad_norm_(self.network.parameters(), self.recipe.clip)
        self._optimizer.step()
        self._schedule.step()
        self.done += 1
        return Step(self.done, float(_sum_over_processes(loss.detach()) / everyone), int(everyone))

    def _loss(self, items: list[Item], graphs: list[Graph]) -> tuple[torch.Tensor, int]:
        """The summed loss of the selected points of some pictures, and their number."""
        graph, _ = together(graphs)
        errors = None if self._errors is None else np.concatenate([self._errors(each.position) for each in items])
        random = np.random.default_rng([self.recipe.seed, 2, items[0].epoch, items[0].position])
        chosen = selected(self.recipe.selection, graph.labels, self.network.shape.classes, errors, random)
        logits = self.network.logits(torch.from_numpy(graph.points), torch.from_numpy(graph.neighbors))
        wanted = torch.from_numpy(np.flatnonzero(chosen))
        labels = torch.from_numpy(graph.labels[chosen].astype(np.int64))
        single = nn.functional.cross_entropy(logits[wanted], labels, reduction="none")
        if self.recipe.loss == "focal":
            single = (1.0 - torch.exp(-single)) ** self.recipe.gamma * single
        return single.sum(), len(wanted)

    def save(self, path: Path) -> None:
        """Write all that going on needs. Raises InputError if it can't be written."""
        state = {
            "done": self.done,
            "network": self.network.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "schedule": self._schedule.state_dict(),
        }
        with written_beside(path) as part:
            torch.save(state, part)

    def load(self, path: Path) -> None:
        """Go on from what `save` wrote. Raises InputError."""
        try:
            state: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
            self.network.load_state_dict(state["network"])
            self._optimizer.load_state_dict(state["optimizer"])
            self._schedule.load_state_dict(state["schedule"])
            self.done = int(state["done"])
        except (OSError, RuntimeError, KeyError, ValueError, EOFError, pickle.UnpicklingError) as error:
            raise InputError(f"can't go on from {path}: {one_line(error)}") from error


def _sum_over_processes(value: torch.Tensor) -> torch.Tensor:
    if distributed.is_initialized():
        distributed.all_reduce(value)
    return value


def _sum_gradients(network: nn.Module) -> None:
    """Every process gets the sum of all gradients."""
    if distributed.is_initialized():
        for each in network.parameters():
            each.grad = torch.zeros_like(each) if each.grad is None else each.grad
            distributed.all_reduce(each.grad)
