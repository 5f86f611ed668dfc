"""The training of a close look on collected patches: train, validate, calibrate."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np
import torch

from vm_embedded import __version__
from vm_embedded.arrays import Image, Mask, Singles
from vm_embedded.borders.text import printable
from vm_embedded.errors import InputError
from vm_embedded.files import write_file
from vm_embedded.network.look_contract import LookContract
from vm_export.eight_bits import round_kernels
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_network import LookNetwork
from vm_workstation.text_tables import shortened

from ..runs.hardware import Hardware
from ..runs.learner import DivergedError
from ..runs.loop import Progress, Training, Validation, shown
from ..scores.calibration import Calibration
from .collection import collect_patches
from .judging import judge_validation
from .labels import OBJECT
from .patch_set import PatchChunk, PatchSet
from .run import LookRun
from .scores import LookResult, LookScore, logits_of
from .trainer import LookTrainer

_EXAMPLES = 2
"""Patches with an object, and as many without, for the self-test of the model file."""


class LookTraining(Training):
    """See runs.loop.Training. Each round goes on with the network of the one before, which grades the patches first."""

    run: LookRun
    learner: LookTrainer
    _patches: TrainingPatches

    def __init__(self, run: LookRun, hardware: Hardware) -> None:
        self.run, self._hardware, recipe = run, hardware, run.configuration.training
        self._rounds = [list(each) for _, each in groupby(range(recipe.epochs), recipe.round_of)]
        super().__init__()
        self.rounds, self.epochs, self.steps = len(self._rounds), range(0), 0

    def begin(self, progress: Progress, stopped: Callable[[], bool]) -> None:
        """Collect the patches and prepare the network, unless the round before did."""
        epochs = self._rounds[progress.round - 1]
        self._progress, self._stopped, self.epochs = progress, stopped, range(epochs[0], epochs[-1] + 1)
        if not self.steps:
            self._patches = collect(self.run, self._hardware.workers, stopped)
            self._describe()
            self._prepare()

    def step(self) -> dict[str, float]:
        """Learn from the next batch."""
        if self.epochs.start and self.learner.done == self.epochs.start * self.steps:
            self.learner.grade()
        return self.learner.step()

    def validate(self) -> Validation:
        """Score the network on the proposals in the validation pictures."""
        score = LookScore.of(self._answers(), self._patches.validation)
        return Validation(asdict(score), *_in_words(score))

    def finish(self) -> None:
        """After the last round, calibrate the network on what it finds in the validation pictures; write look.pt."""
        if self._progress.round < self.rounds:
            return
        run, network, contract = self.run, self.learner.network.cpu().eval(), self._contract()
        round_kernels(network)
        with shown(len(run.split.validation), self._stopped) as report:
            found = judge_validation(run, network, contract, self._hardware.workers, report)
        calibration = Calibration.fit(found.logits, found.right)
        result = LookResult.of(found, calibration)
        logits = self._answers()
        score = LookScore.of(logits, self._patches.validation)
        contract = replace(contract, provenance=self._provenance(score, result))
        examples = _examples(self._patches.validation, logits[:, 0])
        look = LookCheckpoint(network, contract, examples, run.glance())
        source = f"{len(run.split.validation)} validation pictures of {printable(run.data.name)}"
        look.recalibrated(calibration.scale, calibration.offset, source).save(run.result_path)
        write_file(run.folder / "result.json", json.dumps(result.as_dict(), indent=1) + "\n")
        print(f"{run.result_path}: {result}")

    def _prepare(self) -> None:
        """Make the network, from random weights or from those of a trained one."""
        configuration, recipe = self.run.configuration, self.run.configuration.training
        self.steps = -(-len(self._patches.training) // recipe.batch)
        torch.manual_seed(recipe.seed)
        network = LookNetwork(configuration.shape)
        start = self.run.start()
        if start is not None:
            network.load_state_dict(start.network.state_dict())
            network.calibration.copy_(torch.tensor([1.0, 0.0]))  # the end of the training sets it again
        extent, augmentation = configuration.patches.extent, configuration.augmentation
        total, device = recipe.epochs * self.steps, self._hardware.device
        self.learner = LookTrainer(network, self._patches.training, extent, recipe, augmentation, total, device=device)

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
        proposer = "the mesh network proposes" if self.run.glance() is None else "the glance passes on"
        share = 100.0 * found.proposed / found.objects if found.objects else math.nan
        print(f"{proposer} {found.proposed} of {found.objects} visible objects ({share:.0f} %)")
        print("validation AP: average precision of the validation proposals, from 0 to 1", flush=True)

    def _contract(self) -> LookContract:
        """The contract of the network, without provenance."""
        run, patches, glance = self.run, self.run.configuration.patches, self.run.glance()
        return LookContract(
            object_class=run.object_class,
            upright_radius=run.upright_radius,
            size=patches.size,
            extent=patches.extent,
            above=patches.above,
            passes=patches.passes,
            channels=run.configuration.network.channels,
            glance=None if glance is None else glance.contract,
        )

    def _provenance(self, score: LookScore, result: LookResult) -> dict[str, str]:
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
            **run.provenance(),
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


_NAMED = 20
"""Pictures that can't be used, to name."""


@dataclass(frozen=True)
class TrainingPatches:
    """The patches of a run: for training, and proposals for validation. objects: in validation pictures; proposed: of
    these, those that some proposal is at."""

    training: PatchSet
    validation: PatchSet
    objects: int
    proposed: int

    @property
    def pictures(self) -> int:
        """Number of training pictures with patches."""
        return len(np.unique(self.training.pictures))


def collect(run: LookRun, workers: int, stopped: Callable[[], bool]) -> TrainingPatches:
    """Collect the patches of a run, or read those that are collected, and name the pictures that can't be used.

    stopped: whether to stop, which raises KeyboardInterrupt. Raises InputError and VisualMeshError.
    """
    with shown(len(run.numbers), stopped) as report:
        paths = collect_patches(run, workers, report)
    # The patches may fill a large part of the memory: the first pass counts them, the second one keeps them.
    counts = {False: 0, True: 0}
    objects = proposed = 0
    faults: list[str] = []
    for validates, chunk in _chunks(run, paths):
        objects, proposed = objects + chunk.objects, proposed + chunk.proposed
        faults += chunk.faults
        for part in counts:
            counts[part] += int((validates == part).sum())
    for line in shortened(faults, _NAMED, " pictures can't be used"):
        print(f"vm-train: {line}", file=sys.stderr)
    sets = {part: PatchSet.empty(run.configuration.patches.size, count) for part, count in counts.items()}
    ends = {False: 0, True: 0}
    for validates, chunk in _chunks(run, paths):
        for part in sets:
            ends[part] = sets[part].write(ends[part], chunk.patches.part(validates == part))
    _check(run, sets[False], "training")
    _check(run, sets[True], "validation")
    return TrainingPatches(sets[False], sets[True], objects, proposed)


def _chunks(run: LookRun, paths: Sequence[Path]) -> Iterator[tuple[Mask, PatchChunk]]:
    """Each file of patches, and which of its patches (n,) are for validation."""
    numbers = set(run.split.validation)
    validates = np.array([each in numbers for each in run.numbers])
    for path in paths:
        chunk = PatchChunk.load(path)
        yield validates[chunk.patches.pictures], chunk


def _check(run: LookRun, part: PatchSet, name: str) -> None:
    """Raise InputError if a part has no patch with, or none without, an object."""
    if not len(part):
        raise InputError(
            f"no picture for {name} can be used; vm-train check {run.data} tells why (if the masks have other colors, "
            "give them in [classes] of --config)"
        )
    if not 0 < part.objects < len(part):
        found = "none" if not part.objects else "all"
        raise InputError(
            f"{found} of the {len(part)} patches for {name} show the object {run.object_class}: the close look needs "
            f"both; give more pictures if they are few, or check {run.data} with vm-train check, and that {run.model} "
            "proposes objects in it"
        )
