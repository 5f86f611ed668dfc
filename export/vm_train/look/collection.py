"""Collecting the patches of a training: observe each picture with the mesh network, label places, and cut patches.

The number of processes does not change the result, nor does an interruption: finished chunks of pictures stay.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from vm_embedded.errors import GeometryError, InputError

from .configuration import PatchSettings
from .labels import OBJECT, UNLABELED, VISIBLE, label_places
from .observing import Item, Observer, items_of, results_of
from .patch_set import PatchChunk, PatchSet
from .places import jittered_places, proposed_places, random_places
from .run_folder import LookRun
from .torch_look import TorchLook

CHUNK = 100
"""Pictures in a file of patches."""

_SURER = 0.1
"""Share of the usual limit. The glance passes on less in the pictures that it was trained on; with this limit, about as
much as in others."""


@dataclass(frozen=True, eq=False)
class Collector:
    """Cuts the patches of a picture."""

    observer: Observer
    settings: PatchSettings
    glance: TorchLook | None

    @classmethod
    def of(cls, run: LookRun) -> Collector:
        """The collector of a run. Raises InputError or ModelError."""
        return cls(Observer.of(run), run.configuration.patches, TorchLook.of(run.glance()))

    def __call__(self, item: Item) -> PatchChunk:
        """The patches of a picture; none, and a fault, if it can't be used."""
        try:
            return self._collect(item)
        except (InputError, GeometryError) as error:
            text = " ".join(str(error).split())
            return PatchChunk(PatchSet.empty(self.settings.size), 0, 0, (f"picture {item.files.number}: {text}",))

    def _collect(self, item: Item) -> PatchChunk:
        seen = self.observer.observe(item.files)
        observation, truths, view = seen.observation, seen.truths, seen.observation.view
        share = 1.0 if item.validates else _SURER
        places = proposed_places(observation, seen.probabilities, self.settings, self.glance, share)
        if not item.validates:
            random = random_of(self.settings.seed, item.files.number)
            places += jittered_places(view, truths, self.settings, random)
            places += random_places(observation, self.settings, random)
        found = label_places(places.tangents(view), truths)
        kept = found.labels != UNLABELED
        places = places.part(kept)
        patches = PatchSet(
            places.cut(observation, self.settings),
            found.labels[kept],
            found.targets[kept],
            np.full(len(places), item.position, dtype=np.int32),
        )
        if not item.validates:
            return PatchChunk(patches, 0, 0, ())
        hits = set(found.of[found.labels == OBJECT].tolist())
        return PatchChunk(patches, int((truths.visible >= VISIBLE).sum()), len(hits), ())


def collect_patches(run: LookRun, workers: int, report: Callable[[int], None]) -> list[Path]:
    """Collect the patches of all pictures of a run, and return their files, each a PatchChunk.

    workers: processes; 1 uses only this process. report: is called with the number of pictures that are done. Files
    that are already in the folder stay. Raises InputError if a picture is missing, or, in a strict run, can't be used;
    VisualMeshError if a worker was killed.
    """
    items = items_of(run)
    groups = [items[start : start + CHUNK] for start in range(0, len(items), CHUNK)]
    paths = [run.patches / f"{number:05d}.npz" for number in range(len(groups))]
    missing = [(path, group) for path, group in zip(paths, groups, strict=True) if not path.exists()]
    remaining = [item for _, group in missing for item in group]
    done = len(items) - len(remaining)
    report(done)
    with closing(results_of(partial(Collector.of, run), remaining, workers)) as results:
        for path, group in missing:
            parts = []
            for _ in group:
                parts.append(next(results))
                done += 1
                report(done)
            chunk = _joined(run, parts)
            _check(run, chunk)
            chunk.save(path)
    return paths


def _check(run: LookRun, chunk: PatchChunk) -> None:
    if run.strict and chunk.faults:
        raise InputError(
            f"{chunk.faults[0]}; repair it and continue with vm-train resume {run.folder}, or begin again in another "
            "folder without --strict"
        )


def _joined(run: LookRun, parts: Sequence[PatchChunk]) -> PatchChunk:
    return PatchChunk(
        PatchSet.joined(run.configuration.patches.size, [each.patches for each in parts]),
        sum(each.objects for each in parts),
        sum(each.proposed for each in parts),
        tuple(fault for each in parts for fault in each.faults),
    )


def random_of(seed: int, picture: str) -> np.random.Generator:
    """Random numbers that depend only on the seed and the picture's number or file name."""
    digest = hashlib.sha256(f"{seed}:{picture}".encode("utf-8", "surrogateescape")).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "big"))
