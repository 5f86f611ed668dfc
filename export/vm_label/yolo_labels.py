"""Reading boxes in YOLO format: a text file for each image, and the names of the classes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from vm_embedded.errors import InputError
from vm_embedded.output.box_files import CLASSES, Shares

_LARGEST_NUMBER = 10_000
"""Classes have smaller numbers."""


def label_path(image: Path) -> Path:
    """The label file of an image: NAME.txt beside it, or in `labels` if the image is in a folder `images`."""
    beside = image.with_suffix(".txt")
    parts = list(image.parts)
    if beside.exists() or "images" not in parts[:-1]:
        return beside
    index = len(parts) - 2 - parts[-2::-1].index("images")
    return Path(*parts[:index], "labels", *parts[index + 1 :]).with_suffix(".txt")


def read_class_names(folder: Path, top: Path) -> tuple[str, ...]:
    """The names in the nearest classes.txt: in a folder, or in those above it, up to `top`. Empty without a file.

    Raises InputError if the file can't be read, or has a name twice.
    """
    above = [folder, *folder.parents]
    if top in above:
        above = above[: above.index(top) + 1]
    path = next((each / CLASSES for each in above if (each / CLASSES).is_file()), None)
    if path is None:
        return ()
    names = tuple(line.strip() for line in read_text(path).splitlines() if line.strip())
    if len(set(names)) < len(names):
        raise InputError(f"{path} has a name twice: {', '.join(names)}")
    return names


def parse_label(line: str, classes: Sequence[str]) -> tuple[str, Shares, float | None]:
    """Class name, box and confidence of a line: `class x y width height`, and a confidence if there is one.

    classes: the names; without them, a class has its number as its name. The box is clipped to the image. Raises
    InputError, whose message begins with what is wrong.
    """
    words = line.split()
    if len(words) not in (5, 6):
        raise InputError(f"has {len(words)} values; a line is `class x y width height`, and perhaps a confidence")
    try:
        x, y, width, height, *confidence = (float(word) for word in words[1:])
    except ValueError as error:
        raise InputError(f"has a value that is not a number: {line.strip()[:80]!r}") from error
    if not all(map(math.isfinite, (x, y, width, height, *confidence))):
        raise InputError(f"has a value that is not finite: {line.strip()[:80]!r}")
    if confidence and not 0.0 <= confidence[0] <= 1.0:
        raise InputError(f"has the confidence {confidence[0]:g}; it must be from 0 to 1")
    shares = _clipped(x, y, width, height)
    if shares is None:
        raise InputError(f"has a box outside of the image or without an area: {' '.join(words[1:5])}")
    return _class_name(words[0], classes), shares, confidence[0] if confidence else None


def _class_name(word: str, classes: Sequence[str]) -> str:
    if not word.isdecimal() or int(word) >= (len(classes) or _LARGEST_NUMBER):
        allowed = f"0 to {len(classes) - 1}, as in {CLASSES}" if classes else "a whole number from 0"
        raise InputError(f"has the class {word!r}; allowed: {allowed}")
    return classes[int(word)] if classes else str(int(word))


def _clipped(x: float, y: float, width: float, height: float) -> Shares | None:
    """The part of a box that is in the image, or None."""
    left, right = max(x - width / 2, 0.0), min(x + width / 2, 1.0)
    top, bottom = max(y - height / 2, 0.0), min(y + height / 2, 1.0)
    if right - left <= 0.0 or bottom - top <= 0.0:
        return None
    inside = (left, right, top, bottom) == (x - width / 2, x + width / 2, y - height / 2, y + height / 2)
    # A box inside keeps its digits, because candidates.jsonl has the same ones.
    return (x, y, width, height) if inside else ((left + right) / 2, (top + bottom) / 2, right - left, bottom - top)


def read_text(path: Path) -> str:
    """The text of a file. Raises InputError."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"can't read {path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"can't read {path}: it is not UTF-8 text") from error
