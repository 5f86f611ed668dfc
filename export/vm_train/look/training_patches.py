"""All patches of a training, from the files in its folder."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Mask
from vm_embedded.errors import InputError
from vm_workstation.text_tables import shortened

from ..runs.loop import shown
from .collection import collect_patches
from .labels import OBJECT
from .patch_set import PatchChunk, PatchSet
from .run import LookRun

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
