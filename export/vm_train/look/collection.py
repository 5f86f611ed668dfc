"""Collecting the patches of a training: observe each picture with the mesh network, label places, and cut patches."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from vm_embedded.errors import GeometryError, InputError

from .chunks import collect_chunks
from .labels import OBJECT, UNLABELED, VISIBLE, label_places
from .observing import Observer, RunPicture, items_of
from .patch_set import PatchChunk, PatchSet
from .places import jittered_places, proposed_places, random_places
from .run import LookRun

CHUNK = 100
"""Pictures in a file of patches."""


@dataclass(frozen=True, eq=False)
class Collector:
    """Cuts the patches of a picture."""

    run: LookRun
    observer: Observer

    @classmethod
    def of(cls, run: LookRun) -> Collector:
        """The collector of a run. Raises InputError or ModelError."""
        return cls(run, Observer.of(run))

    def __call__(self, item: RunPicture) -> PatchChunk:
        """The patches of a picture; none, and a fault, if it can't be used. In a strict run, raises InputError then."""
        try:
            return self._collect(item)
        except (InputError, GeometryError) as error:
            fault = f"picture {item.files.number}: {' '.join(str(error).split())}"
            if self.run.strict:
                raise InputError(
                    f"{fault}; repair it and continue with vm-train resume {self.run.folder}, or begin again in "
                    "another folder without --strict"
                ) from error
            return PatchChunk(PatchSet.empty(self.run.configuration.patches.size), 0, 0, (fault,))

    def _collect(self, item: RunPicture) -> PatchChunk:
        settings, seen = self.run.configuration.patches, self.observer.observe(item.files)
        observation, truths, view = seen.observation, seen.truths, seen.observation.view
        places = proposed_places(view, seen.peaks, settings)
        if not item.validates:
            random = random_of(settings.seed, item.files.number)
            places += jittered_places(view, truths, settings, random)
            places += random_places(observation, settings, random)
        found = label_places(places.tangents(view), truths)
        kept = found.labels != UNLABELED
        places = places.part(kept)
        patches = PatchSet(
            places.cut(observation, settings),
            found.labels[kept],
            found.targets[kept],
            np.full(len(places), item.position, dtype=np.int32),
        )
        if not item.validates:
            return PatchChunk(patches)
        hits = set(found.of[found.labels == OBJECT].tolist())
        return PatchChunk(patches, int((truths.visible >= VISIBLE).sum()), len(hits), ())


def collect_patches(run: LookRun, workers: int, report: Callable[[int], None]) -> list[Path]:
    """Collect the patches of all pictures of a run, and return their files, each a PatchChunk.

    workers: processes; 1 uses only this process. report: is called with the number of pictures that are done. Files
    that are already in the folder stay. Raises InputError if a picture is missing, or, in a strict run, can't be used;
    VisualMeshError if a worker was killed.
    """
    return collect_chunks(items_of(run), partial(Collector.of, run), CHUNK, run.patches, workers, report)


def random_of(seed: int, picture: str) -> np.random.Generator:
    """Random numbers that depend only on the seed and the picture's number or file name."""
    digest = hashlib.sha256(f"{seed}:{picture}".encode("utf-8", "surrogateescape")).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "big"))
