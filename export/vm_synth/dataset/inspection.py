"""Reads a set: which pictures exist, which files are missing or damaged, and what the pictures show."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded.arrays import Image, number_or_nan
from vm_embedded.cameras.image_files import read_image
from vm_embedded.errors import InputError, VisualMeshError, one_line
from vm_embedded.geometry.lens import Size
from vm_embedded.geometry.lens_files import read_lens_file

from ..scene.configuration import CLASSES
from .files import CLASS_COLORS, FORMAT, PARTS, file_of, indices_in, read_truth
from .plan import read_plan

_SAME_POSE = 1e-6  # [m], [rad], largest difference of equal poses
_STEP = 2  # every second row and column of a mask is counted


@dataclass(frozen=True)
class ObjectFacts:
    """The ball of a picture, or another object to detect.

    distance: on the plane [m]. pixel_radius: radius of a circle with the area of its outline [px]. pixel: its center
    (x, y) [px]. visible: visible share of the outline's area. kind: pattern of a ball, class of another object.
    """

    distance: float
    pixel_radius: float
    pixel: tuple[float, float]
    visible: float
    kind: str


@dataclass(frozen=True)
class Facts:
    """What a picture shows.

    object_name: class of the objects to detect. objects: these. height [m], pitch and roll [rad] of the camera.
    shares: share of the pixels of each class, and "unlabeled"; empty if masks were not read.
    """

    index: int
    map: str
    ground: str
    projection: str
    height: float
    pitch: float
    roll: float
    object_name: str
    objects: tuple[ObjectFacts, ...]
    other_ball: str | None
    shares: dict[str, float]


@dataclass(frozen=True)
class Fault:
    """A picture with an invalid file, and what is wrong."""

    index: int
    text: str


@dataclass(frozen=True)
class Inspection:
    """The state of a set.

    plan: content of set.json. count: pictures in the complete set. size: of the pictures (w, h) [px]. done: numbers of
    the existing pictures. facts and faults: the valid and the invalid ones of these. Pictures with a number beyond the
    count are ignored.
    """

    plan: dict[str, Any]
    count: int
    size: Size
    done: tuple[int, ...]
    facts: tuple[Facts, ...]
    faults: tuple[Fault, ...]

    @property
    def missing(self) -> list[int]:
        """Sorted numbers of the missing pictures."""
        return sorted(set(range(self.count)).difference(self.done))

    @property
    def complete(self) -> bool:
        """Whether all pictures exist and are valid."""
        return not self.faults and len(self.done) == self.count


def read_checked_plan(folder: Path) -> tuple[dict[str, Any], int, list[int]]:
    """The plan of a set, its number of pictures, and the numbers of those that exist. Raises InputError."""
    plan = read_plan(folder)
    if plan.get("format") != FORMAT:
        raise InputError(
            f"{folder / 'set.json'} has format {plan.get('format')!r}; this version of vm-synth reads {FORMAT}"
        )
    count = plan.get("count")
    if not isinstance(count, int) or count < 1:
        raise InputError(f"{folder / 'set.json'} is damaged: count must be a whole number of at least 1, not {count!r}")
    return plan, count, [index for index in indices_in(folder) if index < count]


def inspect(folder: Path, quick: bool = False, report: Callable[[], None] = lambda: None) -> Inspection:
    """Read all existing pictures of a set and call `report` after each. quick: skip images and masks.

    Raises InputError if the folder is not a set.
    """
    plan, count, done = read_checked_plan(folder)
    size = _size(folder, plan)
    names = {entry.name for entry in os.scandir(folder)}
    facts, faults = [], []
    # Threads suffice: decoding releases Python's lock.
    with ThreadPoolExecutor(max(len(os.sched_getaffinity(0)), 1)) as pool:
        try:
            for found in pool.map(
                partial(_inspect_picture, folder, plan.get("maps"), None if quick else size, names), done
            ):
                report()
                if isinstance(found, Fault):
                    faults.append(found)
                else:
                    facts.append(found)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return Inspection(plan, count, size, tuple(done), tuple(facts), tuple(faults))


def _size(folder: Path, plan: dict[str, Any]) -> Size:
    try:
        camera = plan["configuration"]["camera"]
        return int(camera["picture_width"]), int(camera["picture_height"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{folder / 'set.json'} is damaged: it lacks the picture size") from error


def _inspect_picture(folder: Path, maps: Any, size: Size | None, names: set[str], index: int) -> Facts | Fault:
    for part in PARTS:
        if file_of(folder, part, index).name not in names:
            return Fault(index, f"{file_of(folder, part, index).name} is missing")
    try:
        return _read_facts(folder, maps, size, index)
    except InputError as error:
        return Fault(index, " ".join(str(error).replace(f"{folder}{os.sep}", "").split()))


def _read_facts(folder: Path, maps: Any, size: Size | None, index: int) -> Facts:
    truth = read_truth(folder, index)
    lens_path = file_of(folder, "lens", index)
    lens = read_lens_file(lens_path)
    if lens.orientation is None:
        raise InputError(f"{lens_path} has no camera pose (Hoc)")
    shares = {} if size is None else _mask_shares(folder, size, index)
    try:
        if truth["index"] != index:
            raise InputError(f"{file_of(folder, 'scene', index)} describes picture {truth['index']}, not {index}")
        if truth["map"] not in maps:
            raise InputError(f"{file_of(folder, 'scene', index)}: map {truth['map']} is not in set.json")
        name, objects = _objects(truth)
        other = truth["other_ball"]
        pose = lens.orientation
        apart = np.abs(np.array([truth[name] - getattr(pose, name) for name in ("height", "pitch", "roll")]))
        if apart.max() > _SAME_POSE:
            raise InputError(
                f"{lens_path} and {file_of(folder, 'scene', index)} have different poses: one is of another picture"
            )
        return Facts(
            index=index,
            map=str(truth["map"]),
            ground=str(truth["ground"]),
            projection=type(lens.lens).__name__.lower(),
            height=_number(truth["height"]),
            pitch=_number(truth["pitch"]),
            roll=_number(truth["roll"]),
            object_name=name,
            objects=objects,
            other_ball=None if other is None else str(other["label"]),
            shares=shares,
        )
    except VisualMeshError:
        raise
    except KeyError as error:
        raise InputError(f"{file_of(folder, 'scene', index)} is damaged: it lacks {error}") from error
    except (TypeError, ValueError) as error:
        raise InputError(f"{file_of(folder, 'scene', index)} is damaged: {one_line(error)}") from error


def _objects(truth: dict[str, Any]) -> tuple[str, tuple[ObjectFacts, ...]]:
    """The class of the objects to detect, and these objects."""
    if "object" in truth:
        name = str(truth["object"]["name"])
        return name, tuple(_object_facts(each, name) for each in truth["objects"])
    ball = truth["ball"]
    return "ball", () if ball is None else (_object_facts(ball, str(ball["design"]["kind"])),)


def _object_facts(shown: dict[str, Any], kind: str) -> ObjectFacts:
    x, y = shown["pixel"]
    numbers = [_number(shown[name]) for name in ("distance", "pixel_radius", "visible")]
    return ObjectFacts(numbers[0], numbers[1], (_number(x), _number(y)), numbers[2], kind)


def _number(value: Any) -> float:
    number = number_or_nan(value)
    if not math.isfinite(number):
        raise ValueError(f"{value!r} is not a finite number")
    return number


def _mask_shares(folder: Path, size: Size, index: int) -> dict[str, float]:
    """Shares of the classes in a mask. Raises InputError if an image is invalid or has another size (w, h)."""
    images = {}
    for part, channels in (("image", 3), ("coverage", 1), ("mask", 4)):
        path = file_of(folder, part, index)
        image = images[part] = read_image(path, raw=True)
        found = (image.shape[1], image.shape[0])
        if found != size:
            raise InputError(f"{path} has {found[0]} x {found[1]} px, not {size[0]} x {size[1]} px")
        actual = image.shape[2] if image.ndim == 3 else 1
        if actual != channels:
            raise InputError(f"{path} has {actual} channels, not {channels}")
    ball = (images["mask"] == (*CLASS_COLORS["ball"][::-1], 255)).all(axis=-1)
    if (ball & (images["coverage"] == 0)).any():
        path = file_of(folder, "mask", index)
        raise InputError(
            f"{path} shows a ball where {file_of(folder, 'coverage', index)} has none: one is of another picture"
        )
    return class_shares(images["mask"][::_STEP, ::_STEP], file_of(folder, "mask", index))


def class_shares(mask: Image, path: Path) -> dict[str, float]:
    """Share of the pixels of each class, and "unlabeled", in a mask (h, w, 4) BGRA.

    Raises InputError if the mask has other colors.
    """
    values = np.ascontiguousarray(mask).view("<u4").ravel()
    codes = {name: (red << 16) + (green << 8) + blue + (255 << 24) for name, (red, green, blue) in CLASS_COLORS.items()}
    counts = {name: int(np.count_nonzero(values == codes[name])) for name in CLASSES}
    counts["unlabeled"] = int(np.count_nonzero(values >> 24 == 0))
    if sum(counts.values()) != len(values):
        raise InputError(f"{path} has colors that belong to no class")
    return {name: count / len(values) for name, count in counts.items()}
