"""Training of a fine-tuning: a network learns from the user's patches and from rendered ones, and the best epoch stays.

Patches without an object are drawn by the network's errors, which it learns at the beginning and in the middle.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch

from vm_embedded.arrays import Floats
from vm_embedded.cli.progress import ProgressBar
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_network import LookNetwork

from ..learning.log import TrainingLog
from ..learning.trainer import read_state
from ..look.patch_set import PatchSet
from ..look.teacher import LookTeacher
from ..look.trainer import LookTrainer, train_epoch
from .mixing import Mixer
from .run_folder import TuningRun

_RENDERED_VALIDATION = 5
"""One of so many rendered patches is for validation."""


@dataclass(frozen=True, eq=False)
class TuningPatches:
    """Patches of a fine-tuning: the user's own and rendered ones, each for training and for validation."""

    own: PatchSet
    rendered: PatchSet
    own_validation: PatchSet
    rendered_validation: PatchSet

    @classmethod
    def of(cls, run: TuningRun, own: PatchSet, rendered: PatchSet) -> TuningPatches:
        """Divide patches by the run's split."""
        validates = np.isin(own.pictures, np.array(run.split.validation, dtype=np.int64))
        shared = np.arange(len(rendered)) % _RENDERED_VALIDATION == 0
        return cls(own.part(~validates), rendered.part(~shared), own.part(validates), rendered.part(shared))

    def for_training(self, share: float) -> tuple[PatchSet, Floats]:
        """All training patches and their weights (n,), so that `share` of those drawn, of each kind, are own ones."""
        patches = PatchSet.joined(self.own.patches.shape[1], [self.own, self.rendered])
        weights = np.zeros(len(patches))
        is_own = np.arange(len(patches)) < len(self.own)
        for label in np.unique(patches.labels):
            for mine, part in ((True, share), (False, 1.0 - share)):
                rows = (patches.labels == label) & (is_own == mine)
                weights[rows] = part / max(int(rows.sum()), 1)
        return patches, weights


@dataclass
class TuningProgress:
    """How far a fine-tuning is, besides its weights; state.pt keeps these entries.

    validated: number of validated epochs. best: the lowest loss of the user's frames; best_epoch: its epoch, from 1,
    or 0.
    """

    validated: int = 0
    best: float = math.inf
    best_epoch: int = 0


def train_tuned(
    run: TuningRun, before: LookCheckpoint, patches: TuningPatches, stop_requested: Callable[[], bool]
) -> LookNetwork | None:
    """Train a network from `before` on, and calibrate it. Returns None after a stop. Raises InputError."""
    state = read_state(run.state_path) if run.state_path.exists() else None
    return _Training(run, before, patches, state).run(stop_requested)


class _Training:
    """A training in work, from its last state on."""

    def __init__(
        self, run: TuningRun, before: LookCheckpoint, patches: TuningPatches, state: Mapping[str, Any] | None
    ) -> None:
        self._run, self._patches = run, patches
        settings = run.configuration
        self._recipe = settings.training
        self._total = self._recipe.epochs * self._recipe.steps
        training, weights = patches.for_training(self._recipe.own)
        network, old = copy.deepcopy(before.network), before.network.eval()
        self._mixer = Mixer(old, patches.rendered_validation, self._recipe.forgetting)
        is_rendered = torch.arange(len(training)) >= len(patches.own)
        teacher = LookTeacher(old, self._recipe.distillation * is_rendered)
        recipe = self._recipe.as_look_recipe()
        self._trainer = LookTrainer(
            network, training, before.contract.extent, recipe, settings.augmentation, self._total, weights, teacher
        )
        self._progress, self._best = TuningProgress(), _copy(network)
        if state is not None:
            self._trainer.load(state)
            self._progress = TuningProgress(**state["more"]["progress"])
            self._best = dict(state["more"]["best"])
        self._bar = ProgressBar(self._total, "vm-train", self._trainer.done)

    def run(self, stop_requested: Callable[[], bool]) -> LookNetwork | None:
        """Train until the end or a stop, and return the calibrated network of the best epoch; None after a stop."""
        own = self._patches.own
        print(f"{len(own)} patches of your frames, {own.objects} of them show the object", flush=True)
        with TrainingLog(self._run.folder, 1, self._trainer.done, self._progress.validated) as log:
            while self._progress.validated < self._recipe.epochs and not self._is_late():
                if not self._train_epoch(log, stop_requested):
                    return None
        self._bar.clear()
        network = self._trainer.network.eval()
        network.load_state_dict(self._best)
        return network

    def _is_late(self) -> bool:
        """Whether the validation has not become better for too long."""
        return self._progress.validated - self._progress.best_epoch >= self._recipe.patience

    def _train_epoch(self, log: TrainingLog, stop_requested: Callable[[], bool]) -> bool:
        """Train the rest of an epoch, and validate. Returns False after a stop."""
        epoch = self._progress.validated
        if self._trainer.done == epoch * self._recipe.steps and epoch in (0, self._recipe.epochs // 2):
            self._trainer.grade()
        learned = train_epoch(self._trainer, epoch + 1, self._recipe.steps, log, self._bar, self._save, stop_requested)
        if learned is None:
            return False
        self._validate(log, learned)
        self._save()
        return True

    def _validate(self, log: TrainingLog, learned: str) -> None:
        """Keep the network, mixed with the one before, if it is better on the user's frames than those so far.

        Without frames for validation, the last one stays. learned: about the training of the epoch, to print.
        """
        mixture = self._mixer.mix(self._trainer.network)
        own = mixture.loss_of(self._patches.own_validation)
        self._progress.validated += 1
        if math.isnan(own) or own < self._progress.best:
            self._progress.best, self._progress.best_epoch = own, self._progress.validated
            self._best = _copy(mixture.network)
        record = {"epoch": self._progress.validated, "own": own, "rendered": mixture.loss, "share": mixture.share}
        log.write(self._trainer.done, record)
        self._bar.clear()
        yours = "" if math.isnan(own) else f"{own:.3f} for your frames, "
        print(
            f"epoch {self._progress.validated} of {self._recipe.epochs}: validation loss {yours}"
            f"{mixture.loss:.3f} for rendered patches, with {mixture.share:.0%} of the new weights; {learned}",
            flush=True,
        )

    def _save(self) -> None:
        self._trainer.save(self._run.state_path, {"progress": asdict(self._progress), "best": self._best})


def _copy(network: LookNetwork) -> dict[str, torch.Tensor]:
    return {name: value.detach().clone() for name, value in network.state_dict().items()}
