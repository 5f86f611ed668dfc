"""Finds the objects of a class in boxed frames: by the whole detector, or by its close look alone.

The whole detector needs lens and pose of each frame. Without them, the close look searches the entire image for objects
of the sizes that the boxes have.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.cameras.image_files import read_image
from vm_embedded.detection.detector import Detector
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import GeometryError, InputError
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.network.manifest import Manifest
from vm_embedded.network.model_file import ModelFile, read_model
from vm_embedded.network.session import CloseLook
from vm_workstation.worker_process import results_of

from ..boxes.box import Box, BoxedPicture
from ..boxes.checked_boxes import is_cut
from ..boxes.unlabeled import FoundBox
from ..evaluation.box_scores import BoxScores, JudgedFrame
from .boxed_objects import all_objects
from .candidates import ClassLook, search_radii, seen_objects

_LOWEST = 0.05
"""Objects of a lower confidence do not count for the average precision."""

_ABOVE, _CANDIDATES = 0.01, 40
"""Lowest probability in the first pass, and largest number of the places that the close look judges in a frame."""

LOOK_ALONE = (
    "Measured: the close look alone, without lens and pose. It searches the entire image for objects of the sizes that "
    "the boxes have."
)
WHOLE_DETECTOR = "Measured: the whole detector, with lens and pose of each frame."
"""What the scores are of."""

Finder = Callable[[BoxedPicture], list[FoundBox]]
"""Finds the objects of a class in a frame. Raises InputError if it can't be used, and ModelError."""


@dataclass(frozen=True)
class Search:
    """Sizes of objects for a close look: radii (s,) [px], and height over width."""

    radii: Floats
    aspect: float

    @classmethod
    def of(cls, pictures: Sequence[BoxedPicture], name: str, is_round: bool) -> Search:
        """The sizes of the boxes of a class, of which there is one at least."""
        boxes = [(box, each.size) for each in pictures for box in each.boxes if box.name == name]
        shapes = [box.height / box.width for box, size in boxes if not is_round and not is_cut(box, size)]
        return cls(search_radii(all_objects(pictures, name, is_round)), median(shapes or [1.0]))


@dataclass(frozen=True)
class Trial:
    """A network to try. name: as the user knows it. search: for its close look alone, which it must have; None: the
    whole detector."""

    name: str
    model: Path
    settings: Settings
    search: Search | None

    def finder(self) -> Finder:
        """Load the network. Raises InputError and ModelError."""
        model = read_model(self.model)
        if self.search is None:
            lowest = min(self.settings.min_confidence, _LOWEST)
            settings = replace(self.settings, min_confidence=lowest, field_features=False)
            return partial(_found_by_detector, Detector(model, settings), judged_class(model.manifest, self.name))
        return partial(_found_by_look, searching_look(model), self.search)

    def scores(self, frames: Sequence[BoxedPicture], name: str, workers: int, report: Callable[[], None]) -> BoxScores:
        """The scores for a class. workers: processes. report: is called after each frame. Raises as a Finder does."""
        judged = []
        for frame, found in zip(frames, results_of(self.finder, frames, workers), strict=True):
            judged.append(JudgedFrame.of(frame, name, found))
            report()
        return BoxScores(self.name, self.settings.min_confidence, tuple(judged))


def searching_look(model: ModelFile) -> ClassLook:
    """The close look at the objects that a model file with one also finds without lens and pose. Raises ModelError."""
    look, name = CloseLook.of(model), model.manifest.searched_class
    assert look is not None  # a model file without a look is measured with lens and pose
    assert name is not None
    return ClassLook(look, name)


def judged_class(manifest: Manifest, model: str) -> str:
    """The class of objects that is scored: that of the close look, or the only one. Raises InputError for several."""
    if manifest.searched_class is not None:
        return manifest.searched_class
    names = [each.name for each in manifest.classes if each.kind == "object"]
    if len(names) != 1:
        raise InputError(f"{model} has no close look and {len(names)} classes of objects: boxes score one class")
    return names[0]


def _found_by_detector(detector: Detector, name: str, frame: BoxedPicture) -> list[FoundBox]:
    assert frame.lens is not None
    camera = read_lens_file(frame.lens)
    try:
        found = detector.detect(read_image(frame.image), camera.orientation, camera.lens).filter(name)
    except GeometryError as error:
        raise InputError(f"{frame.lens}: {error}") from error
    return [
        FoundBox(frame.image, Box(name, *(edges - 0.5).tolist()), each.confidence)
        for each, edges in zip(found, found.xyxy, strict=True)
    ]


def _found_by_look(look: ClassLook, search: Search, frame: BoxedPicture) -> list[FoundBox]:
    pyramid = Pyramid(read_image(frame.image), "bgr")
    windows, probabilities = seen_objects(pyramid, frame.size, look, search.radii, _ABOVE, _CANDIDATES)
    half = windows.radii[:, None] * (1.0, search.aspect)
    ends = np.array(frame.size) - 0.5
    edges = np.hstack([(windows.centers - half).clip(-0.5, ends), (windows.centers + half).clip(-0.5, ends)])
    return [
        FoundBox(frame.image, Box(look.name, *each), probability)
        for each, probability in zip(edges.tolist(), probabilities.tolist(), strict=True)
        if probability >= _LOWEST
    ]
