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
from .labels import OBJECT, UNLABELED, label_places
from .observing import Observer, RunPicture, items_of
from .patch_set import PatchChunk, PatchSet
from .places import PatchPlaces, jittered_places, random_places
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
            none = PatchSet.empty(self.run.configuration.patches.size)
            return PatchChunk(none, np.zeros((len(self.run.classes), 2), dtype=np.int64), (fault,))

    def _collect(self, item: RunPicture) -> PatchChunk:
        settings = self.run.configuration.patches
        observation, classes = self.observer.observe(item.files)
        random = random_of(settings.seed, item.files.number)
        parts, truths = [], np.zeros((len(classes), 2), dtype=np.int64)
        for kind, seen in enumerate(classes):
            places = PatchPlaces.of(seen.view.shape.center_along(seen.sought.peaks.rays, seen.view.height))
            if not item.validates:
                places += jittered_places(seen.view, seen.truths, settings, random)
                places += random_places(observation, seen.view, settings, random)
            found = label_places(places.tangents(seen.view), seen.truths)
            kept = found.labels != UNLABELED
            places = places.part(kept)
            if item.validates:
                truths[kind] = seen.visible, len(set(found.of[found.labels == OBJECT].tolist()))
            parts.append(
                PatchSet(
                    places.cut(observation.pyramid, seen.view, settings),
                    found.labels[kept],
                    found.targets[kept],
                    np.full(len(places), kind, dtype=np.int8),
                    np.full(len(places), item.position, dtype=np.int32),
                )
            )
        return PatchChunk(PatchSet.joined(settings.size, parts), truths)


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
