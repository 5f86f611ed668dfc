"""Inspection of a data set: facts about each good picture, and the fault of each bad one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np

from vm_embedded.errors import VisualMeshError, unknown
from vm_embedded.geometry.calibrated_lenses import CalibratedLens
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.radial_lenses import RadialLens
from vm_workstation.worker_process import results_of

from .classes import Classes, Labels
from .picture_files import PictureFault, PictureFiles
from .pictures import read_picture

_CHUNK = 16  # pictures that a worker gets at a time


@dataclass(frozen=True)
class PictureFacts:
    """Facts about a good picture.

    size: width and height [px]. lens: kind, as "equisolid"; focal_length [px] and fov [rad]. height [m], pitch and
    roll [rad]: of the camera. pixels: number for each class; unlabeled: number without a class. distances [m]: for each
    connected piece of an object class, from the camera's foot to the point where the ray through the middle of the
    piece meets the plane; infinite if it does not meet it.
    """

    number: str
    size: Size
    lens: str
    focal_length: float
    fov: float
    height: float
    pitch: float
    roll: float
    pixels: tuple[int, ...]
    unlabeled: int
    distances: tuple[float, ...]


@dataclass(frozen=True)
class FaultyPicture:
    """A picture that can't be used: its number, the kind of fault as in PictureFault, and a description."""

    number: str
    kind: str
    text: str


@dataclass(frozen=True)
class Inspection:
    """The result for a data set, in the order of numbers: good pictures with their facts, and faulty pictures."""

    classes: tuple[str, ...]
    good: tuple[PictureFiles, ...]
    facts: tuple[PictureFacts, ...]
    faults: tuple[FaultyPicture, ...]

    @property
    def count(self) -> int:
        """Number of all pictures."""
        return len(self.facts) + len(self.faults)

    @property
    def pixels(self) -> dict[str, int]:
        """Number of pixels of each class."""
        return {name: sum(each.pixels[index] for each in self.facts) for index, name in enumerate(self.classes)}

    @property
    def shown(self) -> dict[str, int]:
        """Number of pictures that show each class."""
        return {name: sum(each.pixels[index] > 0 for each in self.facts) for index, name in enumerate(self.classes)}

    @property
    def absent(self) -> list[str]:
        """Classes that no good picture shows."""
        return [name for name, count in self.shown.items() if not count] if self.facts else []

    @property
    def sizes(self) -> Counter[Size]:
        """Number of pictures of each size [px]."""
        return Counter(each.size for each in self.facts)

    @property
    def lenses(self) -> Counter[str]:
        """Number of pictures with each kind of lens."""
        return Counter(each.lens for each in self.facts)


def inspect_pictures(
    pictures: Sequence[PictureFiles],
    classes: Classes,
    workers: int,
    report: Callable[[], None],
    objects: Sequence[str] = (),
) -> Inspection:
    """Read all pictures with so many processes; 1 uses only this process.

    report: is called after each picture. objects: classes whose distances to measure. Raises VisualMeshError for an
    unknown class and if a worker was killed.
    """
    numbers = [_class_number(name, classes) for name in objects]
    good, facts, faults = [], [], []
    make = partial(partial, _inspect_one, classes=classes, objects=numbers)
    for files, found in zip(pictures, results_of(make, pictures, workers, _CHUNK), strict=True):
        if isinstance(found, FaultyPicture):
            faults.append(found)
        else:
            good.append(files)
            facts.append(found)
        report()
    return Inspection(classes.names, tuple(good), tuple(facts), tuple(faults))


def _class_number(name: str, classes: Classes) -> int:
    if name not in classes.names:
        raise VisualMeshError(unknown("class", name, classes.names))
    return classes.names.index(name)


def _inspect_one(files: PictureFiles, classes: Classes, objects: Sequence[int]) -> PictureFacts | FaultyPicture:
    try:
        picture = read_picture(files, classes)
    except PictureFault as error:
        return FaultyPicture(files.number, error.kind, " ".join(str(error).split()))
    orientation, (width, height) = picture.orientation, picture.size
    pixels = [int(np.count_nonzero(picture.labels == index)) for index in range(len(classes.names))]
    distances = [_distances(picture.labels == index, picture.lens) for index in objects if pixels[index]]
    return PictureFacts(
        files.number,
        (width, height),
        type(picture.lens.lens).__name__.lower().removesuffix("lens"),
        _focal_length(picture.lens.lens),
        picture.lens.lens.fov,
        orientation.height,
        orientation.pitch,
        orientation.roll,
        tuple(pixels),
        width * height - sum(pixels),
        tuple(each for some in distances for each in some),
    )


def _focal_length(lens: Lens) -> float:
    if isinstance(lens, RadialLens):
        return lens.focal_length
    assert isinstance(lens, CalibratedLens)
    return lens.focal_lengths[0]


def _distances(here: Labels, lens: LensFile) -> list[float]:
    """Distances of the connected pieces of a mask (h, w) [m]."""
    assert lens.orientation is not None
    size = (here.shape[1], here.shape[0])
    _, _, _, centers = cv2.connectedComponentsWithStats(here.view(np.uint8))
    rays = lens.lens.for_image(size).unproject(centers[1:].astype(np.float64), size) @ lens.orientation.level.T
    across, down = np.hypot(rays[:, 0], rays[:, 1]), -rays[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.where(down > 0.0, lens.orientation.height * across / down, np.inf)
    return [float(each) for each in found]
