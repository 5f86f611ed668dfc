"""Balls in pictures, as outlines or boxes, and the files that hold them."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats, number_or_nan
from vm_embedded.cameras.frame_source import IMAGE_SUFFIXES
from vm_embedded.cameras.image_files import read_image
from vm_embedded.errors import InputError, unknown
from vm_embedded.files import read_text
from vm_embedded.geometry.lens import Size
from vm_embedded.output.box_files import edges
from vm_workstation.yolo_labels import find_labels, parse_labels, yolo_files
from vm_workstation.yolo_names import NameTables

_OUTLINE, _BOX = ("cx", "cy", "r_px"), ("x0", "y0", "x1", "y1")


@dataclass(frozen=True, eq=False)
class SeenBall:
    """A ball in a picture.

    name: for messages. radius [m]. measured: center x, y and radius (3,) of the circle with the outline's center and
    area, or left, top, right and bottom edge (4,) of its box [px].
    """

    name: str
    radius: float
    measured: Floats

    @property
    def is_box(self) -> bool:
        """Whether a box is known, and not an outline."""
        return len(self.measured) == 4

    @property
    def middle(self) -> Floats:
        """Center (2,) [px]."""
        return np.asarray((self.measured[:2] + self.measured[2:]) / 2.0 if self.is_box else self.measured[:2])

    @property
    def size(self) -> float:
        """Radius in the picture [px]; of a box, from its area."""
        if not self.is_box:
            return float(self.measured[2])
        width, height = self.measured[2:] - self.measured[:2]
        return math.sqrt(width * height) / 2.0

    def cut_off(self, size: Size) -> bool:
        """Whether the ball reaches the edge of a picture of this size [px]."""
        reach = self.size if not self.is_box else (self.measured[2:] - self.measured[:2]) / 2.0
        low, high = self.middle - reach, self.middle + reach
        return bool((low < 0.5).any() or (high > np.array(size) - 1.5).any())


def read_balls(path: Path, radius: float | None, label: str | None, size: Size | None) -> tuple[list[SeenBall], Size]:
    """Balls of a JSON file, or of a folder of pictures with boxes in YOLO format, and the size of the pictures [px].

    radius [m]: of all balls; None if the file has it. label: the class of balls in YOLO files, by its name in the table
    of names, or by its number without one; None takes all boxes. size [px]: of the pictures, for a JSON file. Raises
    InputError with the file and the entry.
    """
    if radius is not None and radius > 1.0:
        raise InputError(
            f"--radius must be a length in meters, at most 1, not {radius:g}; {radius:g} cm are {radius / 100:g}, "
            f"{radius:g} mm are {radius / 1000:g}"
        )
    if radius is not None and not radius > 0.0:
        raise InputError(f"--radius must be a length above 0 m, as in 0.11, not {radius:g}")
    if path.is_dir():
        if radius is None:
            raise InputError("boxes do not tell the size of the ball; give --radius in meters")
        balls, size = _read_yolo(path, radius, label)
    else:
        if size is None:
            raise InputError(
                "the lens file does not have the size of its pictures; give --size, or add an entry "
                "`size: [width, height]`"
            )
        balls = _read_json(path, radius, label)
    if not balls:
        raise InputError(f"{path} has no balls" + (f" of class {label}" if label is not None else ""))
    if len({each.is_box for each in balls}) > 1:
        raise InputError(f"{path} has outlines and boxes; give only one of them")
    return balls, size


def ball_files(path: Path) -> list[Path]:
    """The files that `read_balls` may read: the JSON file, or pictures, label files and tables of names."""
    return [*_pictures(path), *yolo_files(_pictures(path))] if path.is_dir() else [path]


def _read_json(path: Path, radius: float | None, label: str | None) -> list[SeenBall]:
    try:
        table = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not JSON: {error}") from error
    if not isinstance(table, dict) or not all(isinstance(each, list) for each in table.values()):
        raise InputError(f'{path} must map names of pictures to lists of balls, as in {{"a.jpg": [{{"cx": 1, ...}}]}}')
    found = {
        f"{picture}, ball {index}": entry
        for picture, entries in table.items()
        for index, entry in enumerate(entries, start=1)
    }
    classes = sorted({str(each["class"]) for each in found.values() if isinstance(each, dict) and "class" in each})
    if label is None and len(classes) > 1:
        raise InputError(f"{path} has the classes {', '.join(classes)}; choose one with --label")
    if label is not None and label not in classes:
        raise InputError(unknown("--label", label, classes) if classes else f"{path} has no classes; leave out --label")
    return [
        _ball(entry, name, radius, path)
        for name, entry in found.items()
        if label is None or (isinstance(entry, dict) and str(entry.get("class")) == label)
    ]


def _ball(entry: Any, name: str, radius: float | None, path: Path) -> SeenBall:
    if not isinstance(entry, dict):
        raise InputError(f"{path}: {name} must be a table, not {str(entry)[:40]}")
    keys = _BOX if "x0" in entry else _OUTLINE
    missing = [key for key in keys if key not in entry]
    if missing:
        raise InputError(
            f"{path}: {name} has no {missing[0]!r}; a ball needs {', '.join(_OUTLINE)} or {', '.join(_BOX)} in pixels"
        )
    numbers = [_number(entry[key], f"{path}: {key} of {name}") for key in keys]
    size = radius if radius is not None else entry.get("radius")
    if size is None:
        raise InputError(f"{path}: {name} has no radius in meters; give --radius")
    ball = SeenBall(name, _number(size, f"{path}: radius of {name}"), np.array(numbers))
    wrong = ball.measured[2] <= 0.0 if not ball.is_box else (ball.measured[2:] <= ball.measured[:2]).any()
    if wrong or ball.radius <= 0.0:
        raise InputError(f"{path}: {name} is not larger than nothing: {', '.join(f'{each:g}' for each in numbers)}")
    return ball


def _number(value: Any, what: str) -> float:
    number = number_or_nan(value)
    if not math.isfinite(number):
        raise InputError(f"{what} must be a number, not {str(value)[:40]}")
    return number


def _read_yolo(folder: Path, radius: float, label: str | None) -> tuple[list[SeenBall], Size]:
    """Balls of the label files of the pictures in a folder, and the size of the pictures [px]."""
    pictures = _pictures(folder)
    names = NameTables(folder)
    size: Size | None = None
    balls: list[SeenBall] = []
    seen: set[str] = set()
    for picture in pictures:
        path = find_labels(picture)
        if path is None:
            continue
        height, width = read_image(picture).shape[:2]
        if size not in (None, (width, height)):
            raise InputError(f"{picture} has {width} x {height} px, but pictures before it have another size")
        size = (width, height)
        boxes, faults = parse_labels(read_text(path), names.of(path.parent))
        if faults:
            raise InputError(f"{path} {faults[0]}")
        for each in boxes:
            seen.add(each.class_name)
            if label is None or each.class_name == label:
                measured = np.array(edges(each.shares)) * np.tile(size, 2) - 0.5
                balls.append(SeenBall(f"{path.name} line {each.line}", radius, measured))
    if size is None:
        raise InputError(f"{folder} has no picture with a label file NAME.txt in YOLO format")
    if label is not None and label not in seen and seen:
        raise InputError(unknown("--label", label, sorted(seen)))
    return balls, size


def _pictures(folder: Path) -> list[Path]:
    """The pictures in a folder. Raises InputError if it can't be read."""
    try:
        return sorted(each for each in folder.iterdir() if each.suffix.lower() in IMAGE_SUFFIXES)
    except OSError as error:
        raise InputError(f"can't read {folder}: {error.strerror or error}") from error
