"""YOLO text files: one box a line, class x y width height, as shares of the image (center and size)."""

from __future__ import annotations

from pathlib import Path

from vm_embedded.errors import InputError

from .annotation import Annotation, Annotations, RawBox
from .folder_files import FolderFiles, read_text
from .yolo_names import is_name_table, read_names

_ENTRIES = ("class", "x", "y", "width", "height")
_DIGITS = 9  # of a class number


def label_paths(image: Path) -> list[Path]:
    """Where the text file of an image may lie: beside it, in labels/ beside images/, or in labels/ below it."""
    paths = [image.with_suffix(".txt"), image.parent / "labels" / f"{image.stem}.txt"]
    for level, part in enumerate(image.parts[:-1]):
        if part == "images":
            paths.append(Path(*image.parts[:level], "labels", *image.parts[level + 1 :]).with_suffix(".txt"))
    return paths


def is_yolo(files: FolderFiles) -> bool:
    """Whether an image has a text file, or a text file looks like one of an image."""
    return bool(_texts(files))


def read_yolo(files: FolderFiles) -> Annotations:
    """All annotations in YOLO format. Boxes are named by the table of names, or else by their number.

    Raises InputError for an unusable table of names.
    """
    names = read_names(files)
    texts = set(_texts(files))
    found, faults, spoiled = [], [], set()
    for images in files.images_by_key().values():
        path = next((path for path in label_paths(images[0]) if path in texts), None)
        if path is None:
            continue
        texts.remove(path)
        if len(images) > 1:
            labels = " and ".join(files.label(each) for each in images)
            faults.append(f"{labels}: two images with one name; {files.label(path)} may belong to either; not used")
            spoiled.update(images)
            continue
        try:
            boxes, wrong = _read_boxes(read_text(path), files.label(path), names)
        except InputError as error:
            faults.append(f"{files.label(path)}: {error}; {files.label(images[0])} not used")
            spoiled.add(images[0])
            continue
        found.append(Annotation(images[0], files.label(path), tuple(boxes), shares=True))
        faults += wrong
    faults += [f"{files.label(path)}: there is no image for it" for path in sorted(texts)]
    return Annotations(tuple(found), tuple(faults), frozenset(spoiled))


def _texts(files: FolderFiles) -> list[Path]:
    """The text files of images: at their places, or with a first line of numbers."""
    places = {path for image in files.images for path in label_paths(image)}
    texts = [path for path in files.with_suffix(".txt") if not is_name_table(path)]
    return [path for path in texts if path in places or _looks_like_boxes(path)]


def _looks_like_boxes(path: Path) -> bool:
    try:
        lines = read_text(path).split("\n", 1)
        return not lines[0].strip() or (len(lines[0].split()) > 4 and all(map(_number, lines[0].split())))
    except (InputError, ValueError):
        return False


def _number(text: str) -> str:
    float(text)
    return text


def _read_boxes(text: str, label: str, names: tuple[str, ...] | None) -> tuple[list[RawBox], list[str]]:
    """The good boxes of a file's text, and a line for each bad one."""
    boxes, faults = [], []
    for number, line in enumerate(text.splitlines(), start=1):
        place = f"{label} line {number}"
        if line.strip():
            try:
                boxes.append(_parse(line, place, names))
            except InputError as error:
                faults.append(f"{place}: {error}; box not used")
    return boxes, faults


def _parse(line: str, place: str, names: tuple[str, ...] | None) -> RawBox:
    entries = line.split()
    if len(entries) != len(_ENTRIES):
        raise InputError(f"has {len(entries)} entries, but a box has 5: {' '.join(_ENTRIES)}")
    if not (entries[0].isascii() and entries[0].isdigit() and len(entries[0]) <= _DIGITS):
        raise InputError(f"class {entries[0][:20]!r} is not a whole number from 0 up")
    number = int(entries[0])
    if names is not None and number >= len(names):
        raise InputError(f"class {number} is unknown; the table of names has 0 to {len(names) - 1}: {', '.join(names)}")
    values = []
    for name, text in zip(_ENTRIES[1:], entries[1:], strict=True):
        try:
            values.append(float(text))
        except ValueError as error:
            raise InputError(f"{name} {text[:20]!r} is not a number") from error
    x, y, width, height = values
    edges = (x - width / 2.0, y - height / 2.0, x + width / 2.0, y + height / 2.0)
    return RawBox(place, str(number) if names is None else names[number], edges)
