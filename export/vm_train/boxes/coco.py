"""COCO: a JSON file with images, categories and annotations, whose boxes are left, top, width, height in pixels.

Of a polygon without a box, and of a box with a rotation as CVAT writes it, the outer box is read.
"""

from __future__ import annotations

import json
import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path

from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Size
from vm_embedded.output.box_files import Edges

from .annotation import Annotation, Annotations, RawBox
from .coco_file import CocoFile, Entry, Id, coco_files, is_id, number, parse_coco, shown
from .findings import BAD_BOX, BAD_FILE, NO_IMAGE, Finding
from .folder_files import FolderFiles
from .image_index import ImageIndex, image_folders, once_each
from .outer_box import outer_box, outer_box_of_turned

_MOST_SHOWN = 100
"""Most categories in a message, so that many wrong ones do not take long."""


def is_coco(files: FolderFiles) -> bool:
    """Whether the folder has a JSON file that looks like COCO."""
    return bool(coco_files(files))


def read_coco(files: FolderFiles) -> Annotations:
    """All annotations in COCO format. An image is found below the folder by its path or its name."""
    index = ImageIndex(files)
    found: list[Annotation] = []
    faults: list[Finding] = []
    spoiled: set[Path] = set()
    complete = True
    for path in coco_files(files):
        try:
            content = parse_coco(path)
        except InputError as error:
            faults.append(Finding(BAD_FILE, f"{files.label(path)}: {error}; file not used"))
            complete = False
            continue
        reader = _Reader(content, files.label(path), index, [*image_folders(path), files.folder])
        found += reader.annotations()
        faults += reader.faults
        spoiled |= reader.spoiled
    once = once_each(files, found)
    return Annotations(once.found, (*faults, *once.faults), once.spoiled | spoiled, complete)


class _Reader:
    """Reads one file. spoiled: images of bad entries."""

    def __init__(self, content: CocoFile, label: str, index: ImageIndex, near: list[Path]) -> None:
        self._content, self._label, self._index, self._near = content, label, index, near
        self.faults: list[Finding] = []
        self.spoiled: set[Path] = set()

    def annotations(self) -> list[Annotation]:
        """The images that can be used, with their boxes."""
        images = self._images()
        boxes: dict[Id, list[RawBox]] = defaultdict(list)
        ids = [entry["id"] for entry in self._content.images if is_id(entry.get("id"))]
        known = {str(each): each for each in ids} | {each: each for each in ids}  # some programs write 1 as "1"
        for position, entry in enumerate(self._content.annotations):
            name = shown(entry["id"]) if "id" in entry else f"at position {position}"
            place = f"{self._label} annotation {name}"
            key = entry.get("image_id")
            key = known.get(key, known.get(str(key))) if is_id(key) else None
            if key is None:
                text = f"{place}: there is no image with id {shown(entry.get('image_id'))}; box not used"
                self.faults.append(Finding(NO_IMAGE, text))
                continue
            try:
                boxes[key].append(_box(entry, place, self._content.categories))
            except InputError as error:
                text = f"{place}: {error}"
                if key in images:
                    text += f"; {self._index.labels([images[key][0]])} not used"
                    self.spoiled.add(images[key][0])
                self.faults.append(Finding(BAD_BOX, text))
        return [
            Annotation(path, self._label, tuple(boxes[key]), size)
            for key, (path, size) in images.items()
            if path not in self.spoiled
        ]

    def _images(self) -> dict[Id, tuple[Path, Size | None]]:
        """Image file and stated size [px] by id."""
        found: dict[Id, tuple[Path, Size | None]] = {}
        keys: dict[Path, Id] = {}
        unclear: set[str] = set()
        uses = Counter(json.dumps(entry.get("id")) for entry in self._content.images)
        for entry in self._content.images:
            key = entry.get("id")
            place = f"{self._label} image {shown(key)}"
            name = entry.get("file_name")
            if not isinstance(name, str):
                self.faults.append(Finding(NO_IMAGE, f"{place}: file_name {shown(name)} is not a text; not used"))
                continue
            try:
                path = self._index.named(name, self._near)
            except InputError as error:
                self.faults.append(Finding(NO_IMAGE, f"{place}: {error}; not used"))
                if name not in unclear:  # it may stand for thousands of images, in thousands of entries
                    unclear.add(name)
                    self.spoiled.update(self._index.of_name(name))
                continue
            image = self._index.labels([path])
            try:
                if not is_id(key) or uses[json.dumps(key)] > 1:
                    raise InputError("its id must be a number or a text that no other image has")
                if path in keys:
                    raise InputError(f"image {keys[path]} has the same name: two images with one name")
                keys[path] = key
                found[key] = (path, _size(entry))
            except InputError as error:
                self.faults.append(Finding(BAD_FILE, f"{place}: {error}; {image} not used"))
                self.spoiled.add(path)
        return found


def _size(entry: Entry) -> Size | None:
    """The stated width and height [px]; None if they are missing or 0. Raises InputError for other values."""
    values = [entry.get(name) or 0 for name in ("width", "height")]
    try:
        width, height = (int(number(value)) for value in values)
    except (ValueError, OverflowError, InputError) as error:
        raise InputError(f"size {' x '.join(map(shown, values))} is not a width and a height in pixels") from error
    return (width, height) if width and height else None


def _box(entry: Entry, place: str, categories: Mapping[Id, str]) -> RawBox:
    key = entry.get("category_id")
    if not is_id(key) or key not in categories:
        known = ", ".join(f"{each} {name}" for each, name in islice(categories.items(), _MOST_SHOWN))
        raise InputError(f"category {shown(key)} is unknown; categories has {known}"[:400])
    if entry.get("iscrowd"):
        raise InputError(f"marks a crowd of {categories[key]}, not a single one")
    return RawBox(place, categories[key], _edges(entry))


def _edges(entry: Entry) -> Edges:
    """The box of an annotation, or the outer one of its polygons. Raises InputError."""
    bbox, polygons = entry.get("bbox"), entry.get("segmentation")
    if (not bbox or bbox == [0, 0, 0, 0]) and isinstance(polygons, list) and polygons:
        corners = [corner for polygon in polygons for corner in _corners(polygon)]
        return outer_box(corners)
    if not isinstance(bbox, list) or len(bbox) != 4:
        raise InputError(f"bbox {shown(bbox)} is not a list of left, top, width and height")
    left, top, width, height = map(number, bbox)
    edges = (left, top, left + width, top + height)
    attributes = entry.get("attributes")
    turn = attributes.get("rotation") if isinstance(attributes, dict) else None
    return edges if turn is None else outer_box_of_turned(edges, math.radians(number(turn)))


def _corners(polygon: object) -> Iterator[tuple[float, float]]:
    """The corners of a polygon, a list x, y, x, y, and so on. Raises InputError."""
    if not isinstance(polygon, list) or len(polygon) < 6 or len(polygon) % 2:
        raise InputError(f"segmentation {shown(polygon)} is not a list x, y, x, y, ... of three or more corners")
    values = map(number, polygon)
    return zip(values, values, strict=True)
