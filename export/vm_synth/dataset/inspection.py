"""Reading a set back: which pictures are there, which files are missing or broken, and what the pictures show."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded.arrays import Image
from vm_embedded.cameras.image_files import read_image
from vm_embedded.errors import InputError, VisualMeshError, one_line
from vm_embedded.geometry.lens import Size
from vm_embedded.geometry.lens_files import read_lens_file

from ..scene.configuration import CLASSES
from .files import COLORS, FORMAT, PARTS, file_of, indices_in, read_plan, read_truth

_SAME_POSE = 1e-6  # [m], [rad]
_STEP = 2  # pixels of a mask between those that are counted


@dataclass(frozen=True)
class BallFacts:
    """A picture's ball: distance on the plane [m], radius of its picture and place in it [px], share of its outline's
    area that shows, kind of its design."""

    distance: float
    pixel_radius: float
    pixel: tuple[float, float]
    visible: float
    kind: str


@dataclass(frozen=True)
class Facts:
    """What a picture shows: height [m], pitch and roll [rad]; shares of the classes and of unlabeled pixels, by name,
    empty where masks were not read."""

    index: int
    map: str
    ground: str
    projection: str
    height: float
    pitch: float
    roll: float
    ball: BallFacts | None
    other_ball: str | None
    shares: dict[str, float]


@dataclass(frozen=True)
class Fault:
    """A picture whose files can't be used, and why."""

    index: int
    text: str


@dataclass(frozen=True)
class Inspection:
    """A set: its plan as set.json has it, number and size of its pictures, which are complete, what these show, and
    faults.

    Complete pictures with a number beyond the set's count are left out.
    """

    plan: dict[str, Any]
    count: int
    size: Size
    done: tuple[int, ...]
    facts: tuple[Facts, ...]
    faults: tuple[Fault, ...]

    @property
    def missing(self) -> list[int]:
        """Numbers of pictures that are not there, in order."""
        return sorted(set(range(self.count)).difference(self.done))

    @property
    def good(self) -> bool:
        """Whether all pictures are there and none is at fault."""
        return not self.faults and len(self.done) == self.count


def indices_of(folder: Path) -> tuple[dict[str, Any], int, list[int]]:
    """The plan of a set, how many pictures belong to it, and which of them are complete. Raises InputError."""
    plan = read_plan(folder)
    if plan.get("format") != FORMAT:
        raise InputError(f"{folder / 'set.json'} is of format {plan.get('format')!r}, not {FORMAT}: of another version")
    count = plan.get("count")
    if not isinstance(count, int) or count < 1:
        raise InputError(f"{folder / 'set.json'} is damaged: its count is {count!r}")
    return plan, count, [index for index in indices_in(folder) if index < count]


def inspect(folder: Path, quick: bool = False, report: Callable[[], None] = lambda: None) -> Inspection:
    """Read all complete pictures of a set and report each; a quick inspection reads no images and masks.

    Raises InputError if the folder holds no set.
    """
    plan, count, done = indices_of(folder)
    size = _size(folder, plan)
    names = {entry.name for entry in os.scandir(folder)}
    facts, faults = [], []
    # Threads will do: decoding runs beside Python.
    with ThreadPoolExecutor(max(len(os.sched_getaffinity(0)), 1)) as pool:
        try:
            for found in pool.map(partial(_inspected, folder, plan.get("maps"), None if quick else size, names), done):
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
        raise InputError(f"{folder / 'set.json'} is damaged: it lacks the size of pictures") from error


def _inspected(folder: Path, maps: Any, size: Size | None, names: set[str], index: int) -> Facts | Fault:
    for part in PARTS:
        if file_of(folder, part, index).name not in names:
            return Fault(index, f"{file_of(folder, part, index).name} is missing")
    try:
        return _facts(folder, maps, size, index)
    except InputError as error:
        return Fault(index, " ".join(str(error).replace(f"{folder}{os.sep}", "").split()))


def _facts(folder: Path, maps: Any, size: Size | None, index: int) -> Facts:
    truth = read_truth(folder, index)
    lens_path = file_of(folder, "lens", index)
    lens = read_lens_file(lens_path)
    if lens.orientation is None:
        raise InputError(f"{lens_path} has no Hoc")
    shares = {} if size is None else _shares(folder, size, index)
    try:
        if truth["index"] != index:
            raise InputError(f"{file_of(folder, 'scene', index)} is of picture {truth['index']}")
        if truth["map"] not in maps:
            raise InputError(f"{file_of(folder, 'scene', index)}: map {truth['map']} is none of this set's")
        ball, other = truth["ball"], truth["other_ball"]
        pose = lens.orientation
        apart = np.abs(np.array([truth[name] - getattr(pose, name) for name in ("height", "pitch", "roll")]))
        if apart.max() > _SAME_POSE:
            raise InputError(
                f"{lens_path} has another pose than {file_of(folder, 'scene', index)}: files were mixed up"
            )
        return Facts(
            index=index,
            map=str(truth["map"]),
            ground=str(truth["ground"]),
            projection=type(lens.lens).__name__.lower(),
            height=_number(truth["height"]),
            pitch=_number(truth["pitch"]),
            roll=_number(truth["roll"]),
            ball=None if ball is None else _ball_facts(ball),
            other_ball=None if other is None else str(other["label"]),
            shares=shares,
        )
    except VisualMeshError:
        raise
    except KeyError as error:
        raise InputError(f"{file_of(folder, 'scene', index)} is damaged: it lacks {error}") from error
    except (TypeError, ValueError) as error:
        raise InputError(f"{file_of(folder, 'scene', index)} is damaged: {one_line(error)}") from error


def _ball_facts(ball: dict[str, Any]) -> BallFacts:
    x, y = ball["pixel"]
    numbers = [_number(ball[name]) for name in ("distance", "pixel_radius", "visible")]
    return BallFacts(numbers[0], numbers[1], (_number(x), _number(y)), numbers[2], str(ball["design"]["kind"]))


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{value!r} is no finite number")
    return number


def _shares(folder: Path, size: Size, index: int) -> dict[str, float]:
    """Shares of the classes in a picture's mask, once its images have the right size (w, h)."""
    images = {}
    for part, channels in (("image", 3), ("coverage", 1), ("mask", 4)):
        path = file_of(folder, part, index)
        image = images[part] = read_image(path, raw=True)
        found = (image.shape[1], image.shape[0])
        if found != size:
            raise InputError(f"{path} has {found[0]} x {found[1]} px, not {size[0]} x {size[1]}")
        if (image.shape[2] if image.ndim == 3 else 1) != channels:
            raise InputError(f"{path} has not the {channels} channels of a file of its kind")
    ball = (images["mask"] == (*COLORS["ball"][::-1], 255)).all(axis=-1)
    if (ball & (images["coverage"] == 0)).any():
        path = file_of(folder, "mask", index)
        raise InputError(
            f"{path} shows a ball where {file_of(folder, 'coverage', index)} has none: files were mixed up"
        )
    return class_shares(images["mask"][::_STEP, ::_STEP], file_of(folder, "mask", index))


def class_shares(mask: Image, path: Path) -> dict[str, float]:
    """Shares of the classes and of unlabeled pixels in a mask (h, w, 4) BGRA. Raises InputError for another color."""
    values = np.ascontiguousarray(mask).view("<u4").ravel()
    codes = {name: (red << 16) + (green << 8) + blue + (255 << 24) for name, (red, green, blue) in COLORS.items()}
    counts = {name: int(np.count_nonzero(values == codes[name])) for name in CLASSES}
    counts["unlabeled"] = int(np.count_nonzero(values >> 24 == 0))
    if sum(counts.values()) != len(values):
        raise InputError(f"{path} has colors that are no class")
    return {name: count / len(values) for name, count in counts.items()}


def spans(numbers: Iterable[int]) -> list[tuple[int, int]]:
    """Sorted numbers as runs, each by its first and last."""
    found: list[tuple[int, int]] = []
    for number in numbers:
        if found and number == found[-1][1] + 1:
            found[-1] = (found[-1][0], number)
        else:
            found.append((number, number))
    return found


def shard_that_lacks(missing: Sequence[int]) -> tuple[int, int] | None:
    """The shard (I, N) with the largest N that all missing numbers belong to, if there is one.

    A run that was never begun, or ended early, leaves such gaps.
    """
    step = math.gcd(*(after - before for before, after in pairwise(missing)))
    return (missing[0] % step + 1, step) if step > 1 and len(missing) > 2 else None
