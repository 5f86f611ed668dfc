"""Trains a look network step by step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch.nn import functional

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError
from vm_export.look_network import LookNetwork

from ..runs.learner import Learner
from ..runs.optimizer import ScheduledOptimizer
from .augmentation import augment
from .configuration import LookRecipe, PatchAugmentation
from .labels import OBJECT
from .patch_set import PatchSet
from .scores import logits_of
from .teacher import LookTeacher

_PRECISE = 0.1
"""Errors of center and size above this have an absolute instead of a squared loss."""


class LookTrainer(Learner[LookNetwork]):
    """A network that is trained for `total` steps on patches.

    extent: half the side of a patch [expected radii]. weights (n,): how often each patch is drawn, compared to others
    with, or without, an object; None: so that each class comes equally often. teacher: gives the target of some
    patches' presence. device: "cpu" or "cuda:0", as torch names it. Raises InputError if no patch shows an object, or
    all do.
    """

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
        network = network.to(device).train()
        super().__init__(
            network, ScheduledOptimizer(network, recipe.optimizer, recipe.rate, recipe.decay, total), total, device
        )
        self.recipe, self._augmentation, self._patches, self._extent = recipe, augmentation, patches, extent
        self._images, self._targets = torch.from_numpy(patches.patches), torch.from_numpy(patches.targets)
        self._kinds = torch.from_numpy(patches.kinds.astype(np.int64))
        self._with, self._without = (np.flatnonzero((patches.labels == OBJECT) == each) for each in (True, False))
        for chosen, what in ((self._with, "shows an object"), (self._without, "shows no object")):
            if not len(chosen):
                raise InputError(f"none of the {len(patches)} training patches {what}")
        self._errors: npt.NDArray[np.float32] | None = None
        self._weights, self._teacher = _by_class(patches) if weights is None else weights, teacher
        self._shown_chances, self._chances = (np.cumsum(self._weights[rows]) for rows in (self._with, self._without))

    def grade(self) -> None:
        """Draw patches without an object by the network's errors from now on."""
        self.network.eval()
        logits = logits_of(self.network, self._patches.part(self._without))[:, 0]
        self.network.train()
        self._set_errors(0.5 + 0.5 * np.tanh(0.5 * logits))

    def _set_errors(self, errors: npt.NDArray[np.float32]) -> None:
        self._errors = errors
        chances = errors.astype(np.float64) + self.recipe.floor
        self._chances = np.cumsum(chances * self._weights[self._without])

    def step(self) -> dict[str, float]:
        """Learn from one batch. Raises DivergedError if the loss is NaN or infinite.

        Returns the loss and its parts, of presence and of place and size, and the learning rate.
        """
        rate = self.rate
        chosen, shown = self._draw(np.random.default_rng([self.recipe.seed, 1, self.done]))
        random = torch.Generator().manual_seed(_seed(self.recipe.seed, 2, self.done))
        images, targets = self._images[chosen].to(self._device), self._targets[chosen].to(self._device)
        patches, targets = augment(images, targets, self._extent, self._augmentation, random)
        shown = shown.to(self._device)
        kinds = self._kinds[chosen].to(self._device)
        answers = self.network.logits(patches)[torch.arange(len(kinds)), kinds]
        wanted = shown if self._teacher is None else self._teacher.presence(chosen, patches, kinds, shown)
        presence = functional.binary_cross_entropy_with_logits(answers[:, 0], wanted)
        errors = functional.smooth_l1_loss(answers[:, 1:], targets, reduction="none", beta=_PRECISE).sum(dim=1)
        place = (errors * shown).sum() / shown.sum()
        loss = presence + place
        self.learn(loss.item(), loss)
        parts = {"presence": presence.item(), "place": place.item()}
        return {"loss": parts["presence"] + parts["place"], **parts, "rate": rate}

    def _draw(self, random: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
        """Positions (batch,) of the patches of a step, and whether each shows an object (1) or not (0)."""
        batch = self.recipe.batch
        count = min(max(round(self.recipe.positives * batch), 1), batch - 1)
        shown = _drawn(self._with, self._shown_chances, count, random)
        others = _drawn(self._without, self._chances, batch - count, random)
        return torch.from_numpy(np.concatenate([shown, others])), (torch.arange(batch) < count).float()

    def state(self) -> dict[str, Any]:
        """The state to resume from: plain values and tensors."""
        return super().state() | {"errors": None if self._errors is None else torch.from_numpy(self._errors)}

    def _load(self, state: Mapping[str, Any]) -> None:
        super()._load(state)
        if state["errors"] is not None:
            if len(state["errors"]) != len(self._without):
                raise ValueError("it has another number of patches")
            self._set_errors(state["errors"].numpy())


def _by_class(patches: PatchSet) -> Floats:
    """Weights (n,) of patches, with which each class comes as often as any other, with and without an object."""
    weights = np.empty(len(patches))
    for kind in np.unique(patches.kinds):
        for shows in (True, False):
            rows = (patches.kinds == kind) & ((patches.labels == OBJECT) == shows)
            weights[rows] = 1.0 / max(int(rows.sum()), 1)
    return weights


def _drawn(
    rows: npt.NDArray[np.intp], chances: Floats, count: int, random: np.random.Generator
) -> npt.NDArray[np.intp]:
    """`count` of n rows, with repetitions. chances (n,): sums of their chances so far."""
    drawn = np.searchsorted(chances, random.random(count) * chances[-1], side="right")
    return np.asarray(rows[np.minimum(drawn, len(rows) - 1)])


def _seed(*parts: int) -> int:
    """A seed for torch that depends on all parts."""
    return int(np.random.default_rng(parts).integers(2**62))
