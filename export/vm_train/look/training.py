"""The training of a close look on collected patches: train, validate, calibrate."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch

from vm_embedded import __version__
from vm_embedded.arrays import Image, Mask, Singles
from vm_embedded.borders.text import printable
from vm_embedded.errors import InputError
from vm_embedded.files import write_file
from vm_export.eight_bits import round_kernels
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_network import LookNetwork
from vm_workstation.text_tables import shortened

from ..runs.hardware import Hardware
from ..runs.learner import DivergedError
from ..runs.loop import Progress, Training, Validation, shown
from ..scores.calibration import Calibration
from ..scores.object_ranking import Ranking
from .collection import collect_patches
from .labels import OBJECT
from .patch_set import PatchChunk, PatchSet
from .run import LookRun
from .scores import LookScore, logits_of, result_in_words, result_values
from .trainer import LookTrainer
from .validation import judge_validation

_EXAMPLES = 2
"""Patches of each class with an object, and as many without, for the self-test of the model file."""


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
        shape, extent = configuration.shape(len(self.run.classes)), configuration.patches.extent
        network = LookNetwork(shape)
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
        scores = self._scores(self._answers())
        record = {f"{name} {key}": value for name, each in scores.items() for key, value in asdict(each).items()}
        return Validation(record, *_in_words(scores))

    def finish(self) -> None:
        """Calibrate the network on what it finds in the validation pictures; write look.pt."""
        run, network, contract = self.run, self.learner.network.cpu().eval(), self.run.contract
        round_kernels(network)
        with shown(len(run.split.validation), self._stopped) as report:
            found = judge_validation(run, network, contract, self._hardware.workers, report)
        logits = self._answers()
        look = LookCheckpoint(network, contract, _examples(self._patches.validation, logits[:, 0]))
        source = f"{len(run.split.validation)} validation pictures of {printable(run.data.name)}"
        results, values = {}, {}
        for name, each in zip(run.classes, found, strict=True):
            calibration = Calibration.fit(each.confidence, each.right)
            results[name] = replace(each, confidence=calibration.probabilities(each.confidence))
            values[name] = result_values(results[name], calibration)
            look = look.recalibrated(name, calibration.scale, calibration.offset, source)
        provenance = self._provenance(self._scores(logits), results)
        replace(look, contract=replace(look.contract, provenance=provenance)).save(run.result_path)
        write_file(run.folder / "result.json", json.dumps(values, indent=1) + "\n")
        for name, result in results.items():
            print(f"{run.result_path}, {name}: {result_in_words(result)}")

    def _answers(self) -> Singles:
        """Outputs (n, 4) for the patches of the validation. Raises DivergedError if some are NaN or infinite."""
        network, training = self.learner.network, self.learner.network.training
        logits = logits_of(network.eval(), self._patches.validation)
        network.train(training)
        if not np.isfinite(logits).all():
            raise DivergedError("the network's answers are NaN or infinite: begin again with a lower training.rate")
        return logits

    def _scores(self, logits: Singles) -> dict[str, LookScore]:
        """The scores of outputs (n, 4) for the patches of the validation, by class."""
        patches = self._patches.validation
        rows = {name: np.flatnonzero(patches.kinds == kind) for kind, name in enumerate(self.run.classes)}
        return {name: LookScore.of(logits[each], patches.part(each)) for name, each in rows.items()}

    def _describe(self) -> None:
        """Print what was collected."""
        found = self._patches
        for kind, name in enumerate(self.run.classes):
            of = [each.labels[each.kinds == kind] for each in (found.training, found.validation)]
            (learned, shown_there), (judged, shown_here) = ((len(each), int((each == OBJECT).sum())) for each in of)
            objects, proposed = found.truths[kind].tolist()
            share = 100.0 * proposed / objects if objects else math.nan
            print(f"{name}: {learned} patches for training, {shown_there} of them with the object; for validation")
            found_here = f"{proposed} of {objects} visible objects ({share:.0f} %)"
            print(f"  {judged} proposals, {shown_here} of them right: {found_here}")
        print("validation AP: average precision of the validation proposals, from 0 to 1", flush=True)

    def _provenance(self, scores: Mapping[str, LookScore], results: Mapping[str, Ranking]) -> dict[str, str]:
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
            "validation_average_precision": _listed(each.average_precision for each in scores.values()),
            "validation_center_error": _listed(each.center_error for each in scores.values()),
            "objects_average_precision": _listed(each.precision_recall.average_precision for each in results.values()),
            "calibration_error": _listed(each.reliability.error for each in results.values()),
            "torch": str(torch.__version__),
        }


def _listed(values: Iterable[float]) -> str:
    """A value of each class, in their order, for a provenance: names could be longer than its texts may be."""
    return ", ".join(f"{value:.4f}" for value in values)


def _in_words(scores: Mapping[str, LookScore]) -> tuple[str, str]:
    def each(attribute: str, digits: int, factor: float = 1.0) -> str:
        return " / ".join(f"{factor * getattr(score, attribute):.{digits}f}" for score in scores.values())

    return (
        f"validation AP of {' / '.join(scores)} {each('average_precision', 3)}",
        f", center error {each('center_error', 2)} radii, size error {each('size_error', 0, 100.0)} %",
    )


def _examples(validation: PatchSet, presence: Singles) -> Image:
    """Of each class, patches that clearly show an object, and as many that clearly show none: the network is surer of a
    twentieth of each kind."""
    chosen: list[int] = []
    for kind in np.unique(validation.kinds):
        for shows in (True, False):
            rows = np.flatnonzero((validation.kinds == kind) & ((validation.labels == OBJECT) == shows))
            surest = rows[np.argsort(-presence[rows] if shows else presence[rows], kind="stable")]
            start = min(len(surest) // 20, max(len(surest) - _EXAMPLES, 0))
            chosen += surest[start : start + _EXAMPLES].tolist()
    return validation.patches[chosen]


_NAMED = 20
"""Pictures that can't be used, to name."""


@dataclass(frozen=True)
class TrainingPatches:
    """The patches of a run: for training, and proposals for validation. truths (C, 2): see PatchChunk."""

    training: PatchSet
    validation: PatchSet
    truths: npt.NDArray[np.int64]

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
    truths = np.zeros((len(run.classes), 2), dtype=np.int64)
    faults: list[str] = []
    for validates, chunk in _chunks(run, paths):
        truths += chunk.truths
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
    return TrainingPatches(sets[False], sets[True], truths)


def _chunks(run: LookRun, paths: Sequence[Path]) -> Iterator[tuple[Mask, PatchChunk]]:
    """Each file of patches, and which of its patches (n,) are for validation."""
    numbers = set(run.split.validation)
    validates = np.array([each in numbers for each in run.numbers])
    for path in paths:
        chunk = PatchChunk.load(path)
        yield validates[chunk.patches.pictures], chunk


def _check(run: LookRun, part: PatchSet, name: str) -> None:
    """Raise InputError if a part has no patch with, or none without, an object of a class."""
    if not len(part):
        raise InputError(
            f"no picture for {name} can be used; vm-train check {run.data} tells why (if the masks have other colors, "
            "give them in [classes] of --config)"
        )
    for kind, class_name in enumerate(run.classes):
        labels = part.labels[part.kinds == kind]
        shown = int((labels == OBJECT).sum())
        if not 0 < shown < len(labels):
            found = "none" if not shown else "all"
            raise InputError(
                f"{found} of the {len(labels)} patches for {name} show the object {class_name}: the close look needs "
                f"both; give more pictures if they are few, or check {run.data} with vm-train check, and that "
                f"{run.model} proposes objects in it"
            )
