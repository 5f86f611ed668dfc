"""The training of a close look on collected patches: train, validate, calibrate."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import torch

from vm_embedded import __version__
from vm_embedded.arrays import Image, Singles
from vm_embedded.borders.text import printable
from vm_embedded.files import write_file
from vm_embedded.network.look_contract import LookContract
from vm_export.eight_bits import round_kernels
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_network import LookNetwork

from ..runs.hardware import Hardware
from ..runs.learner import DivergedError
from ..runs.loop import Progress, Training, Validation, shown
from ..scores.calibration import Calibration
from ..scores.object_ranking import Ranking
from .labels import OBJECT
from .patch_set import PatchSet
from .run import LookRun
from .scores import LookScore, logits_of, result_in_words, result_values
from .trainer import LookTrainer
from .training_patches import TrainingPatches, collect
from .validation import judge_validation

_EXAMPLES = 2
"""Patches with an object, and as many without, for the self-test of the model file."""


class LookTraining(Training):
    """See runs.loop.Training. Before some epochs, the network grades the patches."""

    run: LookRun
    learner: LookTrainer
    _patches: TrainingPatches

    def __init__(self, run: LookRun, hardware: Hardware) -> None:
        self.run, self._hardware, self.epochs = run, hardware, run.configuration.training.epochs
        super().__init__()

    def begin(self, progress: Progress, stopped: Callable[[], bool]) -> None:
        """Collect the patches and prepare the network."""
        configuration, recipe, self._stopped = self.run.configuration, self.run.configuration.training, stopped
        self._patches = collect(self.run, self._hardware.workers, stopped)
        self._describe()
        self.steps = -(-len(self._patches.training) // recipe.batch)
        torch.manual_seed(recipe.seed)
        network, extent = LookNetwork(configuration.shape), configuration.patches.extent
        augmentation, device = configuration.augmentation, self._hardware.device
        total = recipe.epochs * self.steps
        self.learner = LookTrainer(network, self._patches.training, extent, recipe, augmentation, total, device=device)

    def step(self) -> dict[str, float]:
        """Learn from the next batch."""
        epoch, done = divmod(self.learner.done, self.steps)
        if not done and self.run.configuration.training.begins_round(epoch):
            self.learner.grade()
        return self.learner.step()

    def validate(self) -> Validation:
        """Score the network on the proposals in the validation pictures."""
        score = LookScore.of(self._answers(), self._patches.validation)
        return Validation(asdict(score), *_in_words(score))

    def finish(self) -> None:
        """Calibrate the network on what it finds in the validation pictures; write look.pt."""
        run, network, contract = self.run, self.learner.network.cpu().eval(), self._contract()
        round_kernels(network)
        with shown(len(run.split.validation), self._stopped) as report:
            found = judge_validation(run, network, contract, self._hardware.workers, report)
        calibration = Calibration.fit(found.confidence, found.right)
        result = replace(found, confidence=calibration.probabilities(found.confidence))
        logits = self._answers()
        score = LookScore.of(logits, self._patches.validation)
        contract = replace(contract, provenance=self._provenance(score, result))
        examples = _examples(self._patches.validation, logits[:, 0])
        look = LookCheckpoint(network, contract, examples)
        source = f"{len(run.split.validation)} validation pictures of {printable(run.data.name)}"
        look.recalibrated(calibration.scale, calibration.offset, source).save(run.result_path)
        write_file(run.folder / "result.json", json.dumps(result_values(result, calibration), indent=1) + "\n")
        print(f"{run.result_path}: {result_in_words(result)}")

    def _answers(self) -> Singles:
        """Outputs (n, 4) for the patches of the validation. Raises DivergedError if some are NaN or infinite."""
        network, training = self.learner.network, self.learner.network.training
        logits = logits_of(network.eval(), self._patches.validation.patches)
        network.train(training)
        if not np.isfinite(logits).all():
            raise DivergedError("the network's answers are NaN or infinite: begin again with a lower training.rate")
        return logits

    def _describe(self) -> None:
        """Print what was collected."""
        found, name = self._patches, self.run.object_class
        training, validation = found.training, found.validation
        print(f"training: {len(training)} patches, {training.objects} of them show the object {name}")
        print(f"validation: {len(validation)} proposals, {validation.objects} of them show the object {name}")
        share = 100.0 * found.proposed / found.objects if found.objects else math.nan
        print(f"the mesh network proposes {found.proposed} of {found.objects} visible objects ({share:.0f} %)")
        print("validation AP: average precision of the validation proposals, from 0 to 1", flush=True)

    def _contract(self) -> LookContract:
        """The contract of the network, without provenance."""
        run, patches = self.run, self.run.configuration.patches
        return LookContract(
            object_class=run.object_class,
            upright_radius=run.upright_radius,
            size=patches.size,
            extent=patches.extent,
            max_proposals=patches.max_proposals,
            channels=run.configuration.network.channels,
        )

    def _provenance(self, score: LookScore, result: Ranking) -> dict[str, str]:
        """Where the network comes from, for its contract."""
        run, found, recipe = self.run, self._patches, self.run.configuration.training
        return {
            "made_by": f"vm-train {__version__}",
            "data": printable(run.data.name),
            "training_pictures": str(found.pictures),
            "training_patches": str(len(found.training)),
            "validation_pictures": str(len(run.split.validation)),
            "validation_proposals": str(len(found.validation)),
            "patches_sha256": found.training.sha256(),
            "mesh_sha256": run.digests[run.mesh.name],
            "look_toml_sha256": run.digests["look.toml"],
            "epochs": str(recipe.epochs),
            "rounds": str(recipe.rounds),
            "seed": str(recipe.seed),
            "patches_seed": str(run.configuration.patches.seed),
            "validation_average_precision": f"{score.average_precision:.4f}",
            "validation_center_error": f"{score.center_error:.4f}",
            "objects_average_precision": f"{result.precision_recall.average_precision:.4f}",
            "calibration_error": f"{result.reliability.error:.4f}",
            "torch": str(torch.__version__),
        }


def _in_words(score: LookScore) -> tuple[str, str]:
    return (
        f"validation AP {score.average_precision:.3f}",
        f", center error {score.center_error:.2f} radii, size error {100.0 * score.size_error:.0f} %",
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
