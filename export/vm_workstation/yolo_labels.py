"""Label files in YOLO format: where the one of an image lies, and what its lines say.

A line is `class x y width height`: the number of the class in the table of names, then center and size of a box as
shares of the image. A detector may add a sixth value, its confidence. Or a line is `class x y x y x y ...`: the corners
of a polygon or an oriented box, of which the outer box is read.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from vm_embedded.errors import InputError
from vm_embedded.files import exists, there
from vm_embedded.output.box_files import Shares, edges

from .yolo_names import tables_in

_VALUES = ("x", "y", "width", "height", "confidence")

_VISIBILITY = re.compile(r"[012](\.0*)?")

_MOST_SHOWN = 20
"""Most names in a message about a line."""

_OUTSIDE = 0.1
"""How far a box may reach outside of the image, as a share of the image. Boxes in pixels reach farther."""


@dataclass(frozen=True)
class LabeledBox:
    """A box of a label file.

    line: its number in the file, from 1. shares: a part of the box is in the image, and the rest is near it.
    confidence: from 0 to 1; None if the line has none.
    """

    line: int
    class_name: str
    shares: Shares
    confidence: float | None


def find_labels(image: Path) -> Path | None:
    """The label file of an image, as an absolute path, or None.

    It is NAME.txt beside the image, or else in `labels` in the image's folder, or else in a folder `labels` instead of
    a folder `images` in the image's path; the nearest one counts.
    """
    image = image.absolute()
    places = [image.parent, image.parent / "labels"]
    above = [folder for folder in image.parents if folder.name == "images"]
    places += [folder.with_name("labels") / image.parent.relative_to(folder) for folder in above]
    return next(filter(exists, (there(place / f"{image.stem}.txt") for place in places)), None)


def yolo_files(images: Iterable[Path]) -> Iterator[Path]:
    """The files that boxes of images are read from: their label files, and the tables of names in all folders above."""
    folders: set[Path] = set()
    for labels in filter(None, map(find_labels, images)):
        yield labels
        folders.update(labels.parents)
    for folder in folders:
        yield from tables_in(folder)


def parse_labels(text: str, names: Sequence[str]) -> tuple[list[LabeledBox], list[str]]:
    """The good boxes of a label file, and a text about each bad line: its number, the value and what is allowed.

    names: of the classes, by number; without names, a class has its number as its name. Empty lines are ignored.
    """
    boxes, faults = [], []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip():
            try:
                boxes.append(_parse(line, number, names))
            except InputError as error:
                faults.append(f"line {number}: {error}")
    return boxes, faults


def _parse(line: str, number: int, names: Sequence[str]) -> LabeledBox:
    words = line.split()
    if len(words) in (5, 6):
        x, y, width, height, *confidence = map(_number, _VALUES, words[1:])
    elif _has_corners(words):
        corners = [_number(f"value {at}", word) for at, word in enumerate(words[1:], start=2)]
        (x, width), (y, height) = (
            ((max(each) + min(each)) / 2, max(each) - min(each)) for each in (corners[::2], corners[1::2])
        )
        confidence = []
    else:
        raise InputError(
            f"{line.strip()[:60]!r} has {len(words)} values; allowed: class x y width height, and perhaps a "
            "confidence; or class and three or more corners x y"
        )
    for name, value in (("width", width), ("height", height)):
        if value <= 0.0:
            raise InputError(f"{name} {value:g} must be above 0")
    if confidence and not 0.0 <= confidence[0] <= 1.0:
        raise InputError(f"confidence {confidence[0]:g} must be from 0 to 1")
    shares = (x, y, width, height)
    left, top, right, bottom = edges(shares)
    for axis, low, high in (("x", left, right), ("y", top, bottom)):
        if low < -_OUTSIDE or high > 1.0 + _OUTSIDE or min(high, 1.0) <= max(low, 0.0):
            raise InputError(
                f"the box reaches from {low:g} to {high:g} in {axis}; allowed: shares of the image from 0 to 1, and at "
                f"most {_OUTSIDE:g} outside"
            )
    return LabeledBox(number, _class_name(words[0], names), shares, confidence[0] if confidence else None)


def _has_corners(words: Sequence[str]) -> bool:
    """Whether the words of a line are a class and the corners of a polygon.

    Not if they may also be a box with its confidence and the number of a track, or with key points: x, y and a
    visibility of 0, 1 or 2 each.
    """
    if len(words) < 7 or len(words) % 2 == 0:
        return False
    track = len(words) == 7 and words[6].isdigit()
    points = (len(words) - 5) % 3 == 0 and all(_VISIBILITY.fullmatch(word) for word in words[7::3])
    return not track and not points


def _number(name: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{name} {word[:20]!r} is not a finite number")
    return value


def _class_name(word: str, names: Sequence[str]) -> str:
    if not re.fullmatch("[0-9]{1,9}", word):
        raise InputError(f"class {word[:20]!r} is not a whole number from 0 up")
    number = int(word)
    if names and number >= len(names):
        shown = ", ".join([*names[:_MOST_SHOWN], *(["..."] if len(names) > _MOST_SHOWN else [])])
        raise InputError(f"class {number} is unknown; the table of names has 0 to {len(names) - 1}: {shown}")
    return names[number] if names else str(number)
