"""Collects patches of boxed frames: beside the boxes, at random places, and at the network's own candidates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.cameras.image_files import read_image
from vm_embedded.detection.pyramid import Pyramid

from ..boxes.box import BoxedPicture
from ..look.chunks import collect_chunks
from ..look.collection import random_of
from ..look.labels import UNLABELED
from ..look.patch_set import PatchChunk, PatchSet
from ..look.torch_look import TorchLook
from .boxed_objects import objects_of
from .candidates import ClassLook, find_candidates
from .configuration import WindowSettings
from .run import TuningRun, tuned_look
from .windows import Windows, jittered_windows, random_windows

CHUNK = 20
"""Frames in a file of patches."""


@dataclass(frozen=True, eq=False)
class WindowCollector:
    """Cuts the patches of a frame. look: the network before the fine-tuning. radii (s,): of objects [px]."""

    look: ClassLook
    settings: WindowSettings
    radii: Floats
    is_round: bool

    @classmethod
    def of(cls, run: TuningRun) -> WindowCollector:
        """The collector of a run. Raises InputError or ModelError."""
        before = tuned_look(run.before)
        look = ClassLook(TorchLook(before.network, before.contract), run.object_class)
        return cls(look, run.configuration.patches, run.radii, run.is_round)

    def __call__(self, frame: tuple[int, BoxedPicture]) -> PatchChunk:
        """The patches of a frame, given with its number. Raises InputError if it can't be read any more."""
        (number, picture), settings = frame, self.settings
        pyramid = Pyramid(read_image(picture.image), "bgr")
        objects = objects_of(picture, self.look.name, self.is_round)
        random = random_of(settings.seed, picture.image.name)
        windows = Windows.joined(
            find_candidates(pyramid, picture.size, self.look, self.radii, settings.above, settings.candidates),
            jittered_windows(objects, settings.jittered, settings.jitter, settings.size_jitter, random),
            random_windows(picture.size, self.radii, settings.random, random),
        )
        found = windows.label(objects)
        clear = found.labels != UNLABELED
        patches = windows.part(clear).cut(pyramid, self.look.contract)
        names = self.look.contract.names
        kinds = np.full(len(patches), names.index(self.look.name), dtype=np.int8)
        pictures = np.full(len(patches), number, dtype=np.int32)
        found_patches = PatchSet(patches, found.labels[clear], found.targets[clear], kinds, pictures)
        return PatchChunk(found_patches, np.zeros((len(names), 2), dtype=np.int64))


def collect_windows(run: TuningRun, workers: int, report: Callable[[int], None]) -> PatchSet:
    """Collect the patches of all frames, or read those that are collected.

    workers: processes; 1 uses only this process. report: is called with the number of frames that are done. Raises
    InputError, and VisualMeshError if a worker was killed.
    """
    frames, make, folder = list(enumerate(run.pictures)), partial(WindowCollector.of, run), run.folder / "patches"
    paths = collect_chunks(frames, make, CHUNK, folder, workers, report)
    size = tuned_look(run.before).contract.size
    return PatchSet.joined(size, [PatchChunk.load(path).patches for path in paths])
