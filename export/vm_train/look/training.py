"""A training of a close look on collected patches: train, validate, calibrate. It can be resumed at any step."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np
import torch

from vm_embedded import __version__
from vm_embedded.arrays import Image, Singles
from vm_embedded.borders.text import printable
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError
from vm_embedded.files import write_file
from vm_embedded.network.look_contract import LookContract
from vm_export.eight_bits import round_kernels
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_network import LookNetwork

from ..learning.hardware import Hardware
from ..learning.log import TrainingLog
from ..learning.trainer import read_state
from ..scores.calibration import Calibration
from .collected import Collected
from .judging import Found, judge_validation
from .labels import OBJECT
from .patch_set import PatchSet
from .run_folder import LookRun
from .scores import LookResult, LookScore, logits_of
from .trainer import LookTrainer, train_epoch

_EXAMPLES = 2
"""Patches with an object, and as many without, for the self-test of the model file."""


@dataclass
class LookProgress:
    """How far a training is, besides its weights; state.pt keeps these entries.

    validated: number of validated epochs. finished: whether look.pt is written.
    """

    validated: int = 0
    finished: bool = False


def is_finished(run: LookRun) -> bool:
    """Whether look.pt is written. Raises InputError if the state can't be read."""
    return run.state_path.exists() and LookProgress(**read_state(run.state_path)["more"]).finished


def train_look(run: LookRun, collected: Collected, hardware: Hardware, stop_requested: Callable[[], bool]) -> bool:
    """Train until the end, or until `stop_requested` returns True. Returns whether it is finished.

    hardware: its device trains, its workers look at the validation pictures at the end. On a CPU, the network is the
    same however often the training was stopped or killed. Raises InputError and VisualMeshError.
    """
    state = read_state(run.state_path) if run.state_path.exists() else None
    progress = LookProgress() if state is None else LookProgress(**state["more"])
    return _Training(run, collected, hardware, progress, state).run(stop_requested)


class _Training:
    """A training in work, from its last state on."""

    def __init__(
        self,
        run: LookRun,
        collected: Collected,
        hardware: Hardware,
        progress: LookProgress,
        state: dict[str, Any] | None,
    ) -> None:
        self._run, self._collected, self._workers, self._progress = run, collected, hardware.workers, progress
        self._recipe = recipe = run.configuration.training
        self._epoch_steps = -(-len(collected.training) // recipe.batch)
        torch.manual_seed(recipe.seed)
        network = LookNetwork(run.configuration.shape)
        start = run.start()
        if start is not None:
            network.load_state_dict(start.network.state_dict())
            network.calibration.copy_(torch.tensor([1.0, 0.0]))  # the end of the training sets it again
        total = recipe.epochs * self._epoch_steps
        extent, augmentation = run.configuration.patches.extent, run.configuration.augmentation
        self._trainer = LookTrainer(
            network, collected.training, extent, recipe, augmentation, total, device=hardware.device
        )
        if state is not None:
            self._trainer.load(state)
        self._bar = ProgressBar(total, "vm-train", self._trainer.done)

    def run(self, stop_requested: Callable[[], bool]) -> bool:
        """Train until the end or a stop. Returns whether it is finished."""
        self._describe()
        for number, group in groupby(range(self._recipe.epochs), self._recipe.round_of):
            epochs = list(group)
            if epochs[-1] < self._progress.validated:
                continue
            with TrainingLog(self._run.folder, number + 1, self._trainer.done, self._progress.validated) as log:
                if number and self._trainer.done == epochs[0] * self._epoch_steps:
                    self._trainer.grade()
                for epoch in epochs[max(self._progress.validated - epochs[0], 0) :]:
                    if not self._train_epoch(epoch, log, stop_requested):
                        return False
        return self._finish(stop_requested)

    def _train_epoch(self, epoch: int, log: TrainingLog, stop_requested: Callable[[], bool]) -> bool:
        """Train the rest of an epoch, counted from 0, and validate. Returns False after a stop."""
        learned = train_epoch(self._trainer, epoch + 1, self._epoch_steps, log, self._bar, self._save, stop_requested)
        if learned is None:
            return False
        score = LookScore.of(self._validate(), self._collected.validation)
        self._progress.validated += 1
        log.write(self._trainer.done, {"epoch": self._progress.validated} | asdict(score))
        self._bar.clear()
        number = f"epoch {self._progress.validated} of {self._recipe.epochs}"
        print(f"{number}: {_description(score)}; {learned}", flush=True)
        self._save()
        return True

    def _validate(self) -> Singles:
        """Outputs (n, 4) for the patches of the validation. Raises InputError if some are NaN or infinite."""
        self._trainer.network.eval()
        logits = logits_of(self._trainer.network, self._collected.validation.patches)
        self._trainer.network.train()
        if not np.isfinite(logits).all():
            raise InputError("the network's answers are NaN or infinite: begin again with a lower training.rate")
        return logits

    def _save(self) -> None:
        self._trainer.save(self._run.state_path, asdict(self._progress))

    def _describe(self) -> None:
        """Print what was collected."""
        found = self._collected
        name, training, validation = self._run.object_class, found.training, found.validation
        print(f"training: {len(training)} patches, {training.objects} of them show the object {name}")
        print(f"validation: {len(validation)} proposals, {validation.objects} of them show the object {name}")
        share = 100.0 * found.proposed / found.objects if found.objects else math.nan
        print(f"the mesh network proposes {found.proposed} of {found.objects} visible objects ({share:.0f} %)")
        print("validation AP: average precision of the validation proposals, from 0 to 1", flush=True)

    def _finish(self, stop_requested: Callable[[], bool]) -> bool:
        """Calibrate the network on what it finds in the validation pictures, and write look.pt. False after a stop."""
        run, network, patches = self._run, self._trainer.network.cpu().eval(), self._run.configuration.patches
        round_kernels(network)
        contract = LookContract(
            object_class=run.object_class,
            upright_radius=run.upright_radius,
            size=patches.size,
            extent=patches.extent,
            max_proposals=patches.max_proposals,
            passes=patches.passes,
            channels=run.configuration.network.channels,
        )
        found = self._judge(network, contract, stop_requested)
        if found is None:
            return False
        calibration = Calibration.fit(found.logits, found.right)
        result = LookResult.of(found, calibration)
        logits = self._validate()
        score = LookScore.of(logits, self._collected.validation)
        contract = replace(contract, provenance=self._provenance(score, result))
        examples = _examples(self._collected.validation, logits[:, 0])
        look = LookCheckpoint(network, contract, examples)
        source = f"{len(run.split.validation)} validation pictures of {printable(run.data.name)}"
        look.recalibrated(calibration.scale, calibration.offset, source).save(run.look_path)
        write_file(run.folder / "result.json", json.dumps(result.as_dict(), indent=1) + "\n")
        print(f"{run.look_path}: {result}")
        self._progress.finished = True
        self._save()
        return True

    def _judge(self, network: LookNetwork, contract: LookContract, stop_requested: Callable[[], bool]) -> Found | None:
        bar = ProgressBar(len(self._run.split.validation), "vm-train")

        def stop(done: int) -> bool:
            bar.show(done)
            return stop_requested()

        try:
            return judge_validation(self._run, network, contract, self._workers, stop)
        finally:
            bar.clear()

    def _provenance(self, score: LookScore, result: LookResult) -> dict[str, str]:
        """Where the network comes from, for its contract."""
        run, found, recipe = self._run, self._collected, self._recipe
        start = {"start_sha256": run.start_sha256} if run.start_sha256 else {}
        return {
            "made_by": f"vm-train {__version__}",
            "data": printable(run.data.name),
            "training_pictures": str(found.pictures),
            "training_patches": str(len(found.training)),
            "validation_pictures": str(len(run.split.validation)),
            "validation_proposals": str(len(found.validation)),
            "patches_sha256": found.training.sha256(),
            "mesh_sha256": run.mesh_sha256,
            "configuration_sha256": run.configuration_sha256,
            **start,
            "epochs": str(recipe.epochs),
            "rounds": str(recipe.rounds),
            "seed": str(recipe.seed),
            "patches_seed": str(run.configuration.patches.seed),
            "validation_average_precision": f"{score.average_precision:.4f}",
            "validation_center_error": f"{score.center_error:.4f}",
            "objects_average_precision": f"{result.average_precision:.4f}",
            "calibration_error": f"{result.calibration_error:.4f}",
            "torch": str(torch.__version__),
        }


def _description(score: LookScore) -> str:
    return (
        f"validation AP {score.average_precision:.3f}, center error {score.center_error:.2f} radii, "
        f"size error {100.0 * score.size_error:.0f} %"
    )


def _examples(validation: PatchSet, presence: Singles) -> Image:
    """Patches that clearly show an object or clearly none: the network is surer of a twentieth of each kind."""
    chosen: list[int] = []
    for shows in (True, False):
        rows = np.flatnonzero((validation.labels == OBJECT) == shows)
        surest = rows[np.argsort(-presence[rows] if shows else presence[rows], kind="stable")]
        start = min(len(surest) // 20, max(len(surest) - _EXAMPLES, 0))
        chosen += surest[start : start + _EXAMPLES].tolist()
    return validation.patches[chosen]
