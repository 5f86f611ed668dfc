"""Reading a folder of boxes: from vm-detect --save-boxes, or in YOLO format from another tool."""

from __future__ import annotations

import json
import os
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from vm_embedded.cameras.frame_source import IMAGE_SUFFIXES
from vm_embedded.errors import InputError, unknown
from vm_embedded.files import exists, read_text
from vm_embedded.output.box_files import CANDIDATES, SAME_PLACE, CandidateBox, Shares, edges, overlap
from vm_workstation.box_grid import BoxGrid
from vm_workstation.class_names import class_name
from vm_workstation.yolo_labels import LabeledBox, find_labels, parse_labels
from vm_workstation.yolo_names import NameTables

from .crops import Crop


@dataclass(frozen=True)
class BoxFolder:
    """The images and boxes in a folder and in the folders in it.

    images: paths relative to the folder. classes: names of the classes. faulty: images whose boxes are not all
    readable. problems: a line of text for each fault.
    """

    path: Path
    images: tuple[str, ...]
    classes: tuple[str, ...]
    crops: tuple[Crop, ...]
    faulty: frozenset[str]
    problems: tuple[str, ...]


def read_box_folder(path: Path, only: Sequence[str] = ()) -> BoxFolder:
    """Read a folder of boxes. only: names of the classes to read; all if empty.

    A box that can't be read is a problem; the rest is used. Raises InputError if the folder has no images, an unusable
    table of names, or none of a class of `only`.
    """
    reader = _Reader(path)
    images = sorted(_images(path))
    if not images:
        raise InputError(f"no images in {path} (looked for {', '.join(IMAGE_SUFFIXES)})")
    stems = Counter(image.with_suffix("") for image in images)
    for image in images:
        if stems[image.with_suffix("")] > 1:
            reader.report(image, f"{image}: another image has the same name, so {image.stem}.txt is ambiguous")
        else:
            reader.read(image)
    for name in only:
        if name not in reader.classes:
            raise InputError(unknown("class", name, reader.classes))
    crops = dict.fromkeys(crop for crop in reader.crops if not only or crop.class_name in only)
    return BoxFolder(
        path,
        tuple(image.relative_to(path).as_posix() for image in images),
        tuple(name for name in reader.classes if not only or name in only),
        tuple(crops),
        frozenset(reader.faulty),
        tuple(reader.problems),
    )


def with_drawn(folder: BoxFolder, drawn: Iterable[Crop], only: Sequence[str] = ()) -> BoxFolder:
    """The folder with the boxes that a person drew. only: as in `read_box_folder`.

    A box of an image that is not there any more is a problem.
    """
    chosen = [crop for crop in drawn if not only or crop.class_name in only]
    images = set(folder.images)
    there = [crop for crop in chosen if crop.image in images]
    gone = [
        f"{folder.path / crop.image}: a {crop.class_name} was drawn in this image, but there is no such image"
        for crop in chosen
        if crop.image not in images
    ]
    return replace(
        folder,
        classes=tuple(dict.fromkeys([*folder.classes, *(crop.class_name for crop in there)])),
        crops=(*folder.crops, *there),
        problems=(*folder.problems, *gone),
    )


class _Reader:
    """Collects the crops, classes and problems of a folder's images."""

    def __init__(self, top: Path) -> None:
        self._top = top
        self._names = NameTables(top)
        self._candidates: dict[Path, dict[str, list[CandidateBox]]] = {}
        self.classes: dict[str, None] = {}
        self.crops: list[Crop] = []
        self.faulty: set[str] = set()
        self.problems: list[str] = []

    def report(self, image: Path, problem: str) -> None:
        """Note that not all boxes of an image can be read."""
        self.faulty.add(image.relative_to(self._top).as_posix())
        self.problems.append(problem)

    def read(self, image: Path) -> None:
        """Read the boxes of an image: those of its label file, with their confidences, and the near misses."""
        name = image.relative_to(self._top).as_posix()
        candidates = self._candidates_of(image)
        confidences = {(each.class_name, each.shares): each.confidence for each in candidates}
        crops: dict[Crop, None] = {}
        for box in self._labels(image):
            shares = clipped(box.shares)
            known = confidences.get((box.class_name, shares)) if box.confidence is None else box.confidence
            crops[Crop(name, box.class_name, shares, known)] = None
        places = BoxGrid(SAME_PLACE)
        for crop in crops:
            places.add(crop.class_name, edges(crop.shares))
        for each in candidates:
            place = edges(each.shares)
            if not each.found and all(
                overlap(place, at) <= SAME_PLACE for _, at in places.near(each.class_name, place)
            ):
                crops[Crop(name, each.class_name, each.shares, each.confidence)] = None
                places.add(each.class_name, place)
        self.classes |= dict.fromkeys(crop.class_name for crop in crops)
        self.crops += crops  # each once

    def _labels(self, image: Path) -> list[LabeledBox]:
        """The boxes in the label file of an image; each fault is reported."""
        path = find_labels(image)
        names = self._names.of((path or image).parent)
        self.classes |= dict.fromkeys(names)
        try:
            boxes, faults = parse_labels(read_text(path), names) if path else ([], [])
        except InputError as error:
            self.report(image, str(error))
            return []
        for fault in faults:
            self.report(image, f"{path} {fault}")
        return boxes

    def _candidates_of(self, image: Path) -> list[CandidateBox]:
        if image.parent not in self._candidates:
            path = image.parent / CANDIDATES
            self._candidates[image.parent], faults = read_candidates(path) if exists(path) else ({}, [])
            self.problems += faults
        return self._candidates[image.parent].get(image.name, [])


def clipped(shares: Shares) -> Shares:
    """The part of a box that is in the image."""
    left, top, right, bottom = (min(max(each, 0.0), 1.0) for each in edges(shares))
    if (left, top, right, bottom) == edges(shares):
        return shares  # with its digits, because candidates.jsonl has the same ones
    return (left + right) / 2, (top + bottom) / 2, right - left, bottom - top


def read_candidates(path: Path) -> tuple[dict[str, list[CandidateBox]], list[str]]:
    """The boxes in a candidates.jsonl by the name of their image, and a line of text for each line that has none.

    Raises InputError if the file can't be read.
    """
    found: dict[str, list[CandidateBox]] = defaultdict(list)
    faults = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        try:
            fields = json.loads(line)
            x, y, width, height = (float(each) for each in fields["box"])
            confidence = float(fields["confidence"])
            if not all(0.0 <= each <= 1.0 for each in (x, y, width, height, confidence)) or not width * height:
                raise ValueError("values out of range")
            name = class_name(str(fields["class"]))
            box = CandidateBox(name, (x, y, width, height), confidence, bool(fields["found"]))
            found[str(fields["image"])].append(box)
        except InputError as error:
            faults.append(f"{path}: line {number}: {error}; it is ignored")
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
            faults.append(f"{path}: line {number} is not a box; it is ignored")
    return found, faults


def _images(path: Path) -> Iterator[Path]:
    """The images in a folder and in its folders, without hidden ones. Raises InputError."""

    def fail(error: OSError) -> None:
        raise InputError(f"can't read {error.filename or path}: {error.strerror or error}") from error

    for folder, folders, files in os.walk(path, onerror=fail):
        folders[:] = [each for each in folders if not each.startswith(".")]
        for name in files:
            if PurePosixPath(name).suffix.lower() in IMAGE_SUFFIXES and not name.startswith("."):
                yield Path(folder, name)
