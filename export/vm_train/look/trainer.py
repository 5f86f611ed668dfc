"""Trains a look network step by step, and saves and loads the state between two steps.

A step depends only on the seed, its number and the weights before it. So a training that resumes from its last state
ends with the same weights.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch.nn import functional

from vm_embedded.arrays import Floats
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError, one_line
from vm_export.look_network import LookNetwork
from vm_export.torch_files import save_values

from ..learning.log import TrainingLog
from ..learning.optimizer import ScheduledOptimizer
from ..learning.recipe import Recipe
from .augmentation import augment
from .configuration import LookRecipe, PatchAugmentation
from .labels import OBJECT
from .patch_set import PatchSet
from .scores import logits_of
from .teacher import LookTeacher

_PRECISE = 0.1
"""Errors of center and size above this have an absolute instead of a squared loss."""

_SAVE_INTERVAL = 30.0
"""Time between two states [s]."""


@dataclass(frozen=True)
class LookStep:
    """A step's number, from 1, its losses of presence and of place and size, and the learning rate."""

    number: int
    presence: float
    place: float
    rate: float


class LookTrainer:
    """A network that is trained for `total` steps on patches.

    extent: half the side of a patch [expected radii]. weights (n,): how often each patch is drawn, compared to others
    of its kind; None: equally often. teacher: gives the target of some patches' presence. device: "cpu" or "cuda:0", as
    torch names it. Raises InputError if no patch shows an object, or all do."""

    def __init__(
        self,
        network: LookNetwork,
        patches: PatchSet,
        extent: float,
        recipe: LookRecipe,
        augmentation: PatchAugmentation,
        total: int,
        weights: Floats | None = None,
        teacher: LookTeacher | None = None,
        device: str = "cpu",
    ) -> None:
        self.network, self._device = network.to(device).train(), device
        self.recipe, self.total, self.done = recipe, total, 0
        self._augmentation, self._patches, self._extent = augmentation, patches, extent
        self._images, self._targets = torch.from_numpy(patches.patches), torch.from_numpy(patches.targets)
        self._with, self._without = (np.flatnonzero((patches.labels == OBJECT) == each) for each in (True, False))
        for chosen, what in ((self._with, "shows an object"), (self._without, "shows no object")):
            if not len(chosen):
                raise InputError(f"none of the {len(patches)} training patches {what}")
        self._errors: npt.NDArray[np.float32] | None = None
        self._weights, self._teacher = weights, teacher
        self._shown_chances, self._chances = (
            None if weights is None else np.cumsum(weights[rows]) for rows in (self._with, self._without)
        )
        self._optimizer = ScheduledOptimizer(
            network, Recipe(optimizer=recipe.optimizer, rate=recipe.rate, decay=recipe.decay), total
        )

    @property
    def rate(self) -> float:
        """The learning rate of the next step."""
        return self._optimizer.rate

    def grade(self) -> None:
        """Draw patches without an object by the network's errors from now on."""
        self.network.eval()
        logits = logits_of(self.network, self._patches.patches[self._without])[:, 0]
        self.network.train()
        self._set_errors(0.5 + 0.5 * np.tanh(0.5 * logits))

    def _set_errors(self, errors: npt.NDArray[np.float32]) -> None:
        self._errors = errors
        chances = errors.astype(np.float64) + self.recipe.floor
        self._chances = np.cumsum(chances if self._weights is None else chances * self._weights[self._without])

    def step(self) -> LookStep:
        """Learn from one batch. Raises InputError if the loss is NaN or infinite."""
        rate = self._optimizer.rate
        chosen, shown = self._draw(np.random.default_rng([self.recipe.seed, 1, self.done]))
        random = torch.Generator().manual_seed(_seed(self.recipe.seed, 2, self.done))
        images, targets = self._images[chosen].to(self._device), self._targets[chosen].to(self._device)
        patches, targets = augment(images, targets, self._extent, self._augmentation, random)
        shown = shown.to(self._device)
        answers = self.network.logits(patches)
        wanted = shown if self._teacher is None else self._teacher.presence(chosen, patches, shown)
        presence = functional.binary_cross_entropy_with_logits(answers[:, 0], wanted)
        errors = functional.smooth_l1_loss(answers[:, 1:], targets, reduction="none", beta=_PRECISE).sum(dim=1)
        place = (errors * shown).sum() / shown.sum()
        loss = presence + place
        if not math.isfinite(loss.item()):
            raise InputError(
                f"the loss of step {self.done + 1} is NaN or infinite: begin again with a lower training.rate"
            )
        self._optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self._optimizer.step()
        self.done += 1
        return LookStep(self.done, presence.item(), place.item(), rate)

    def _draw(self, random: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
        """Positions (batch,) of the patches of a step, and whether each shows an object (1) or not (0)."""
        batch = self.recipe.batch
        count = min(max(round(self.recipe.positives * batch), 1), batch - 1)
        shown = _drawn(self._with, self._shown_chances, count, random)
        others = _drawn(self._without, self._chances, batch - count, random)
        return torch.from_numpy(np.concatenate([shown, others])), (torch.arange(batch) < count).float()

    def save(self, path: Path, more: Mapping[str, Any]) -> None:
        """Write the state to resume from, with `more` plain values. Raises InputError if it can't be written."""
        state = {
            "done": self.done,
            "network": self.network.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "errors": None if self._errors is None else torch.from_numpy(self._errors),
            "more": dict(more),
        }
        save_values(path, state)

    def load(self, state: Mapping[str, Any]) -> None:
        """Resume from a state that `read_state` read. Raises InputError if it belongs to another training."""
        try:
            self.network.load_state_dict(state["network"])
            self._optimizer.load_state_dict(state["optimizer"])
            if state["errors"] is not None:
                if len(state["errors"]) != len(self._without):
                    raise ValueError("it has another number of patches")
                self._set_errors(state["errors"].numpy())
            self.done = int(state["done"])
        except (RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
            raise InputError(f"the state belongs to another training: {one_line(error)}") from error


def train_epoch(
    trainer: LookTrainer,
    epoch: int,
    steps: int,
    log: TrainingLog,
    bar: ProgressBar,
    save: Callable[[], None],
    stop_requested: Callable[[], bool],
) -> str | None:
    """Train the rest of an epoch, counted from 1, of so many steps.

    Returns mean loss, learning rate and time left, in words; None after a stop. save: writes the state, now and then
    and at a stop. Raises InputError if the loss is NaN or infinite.
    """
    saved, all_losses = perf_counter(), []
    while trainer.done < epoch * steps:
        step = trainer.step()
        losses = {"loss": step.presence + step.place, "presence": step.presence, "place": step.place}
        log.write(step.number, losses | {"rate": step.rate})
        all_losses.append(losses["loss"])
        bar.note = f"epoch {epoch}, loss {losses['loss']:.3f}"
        bar.advance()
        if stop_requested():
            bar.clear()
            save()
            return None
        if perf_counter() - saved > _SAVE_INTERVAL:
            save()
            saved = perf_counter()
    loss = f"loss {np.mean(all_losses):.3f}, " if all_losses else ""  # none after a stop before a validation
    return f"{loss}learning rate {trainer.rate:.2g}, {bar.left}"


def _drawn(
    rows: npt.NDArray[np.intp], chances: Floats | None, count: int, random: np.random.Generator
) -> npt.NDArray[np.intp]:
    """`count` of n rows, with repetitions. chances (n,): sums of their chances so far; None: all have the same."""
    if chances is None:
        return np.asarray(rows[random.integers(len(rows), size=count)])
    drawn = np.searchsorted(chances, random.random(count) * chances[-1], side="right")
    return np.asarray(rows[np.minimum(drawn, len(rows) - 1)])


def _seed(*parts: int) -> int:
    """A seed for torch that depends on all parts."""
    return int(np.random.default_rng(parts).integers(2**62))
