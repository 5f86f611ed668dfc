"""Pascal VOC: an XML file for each image, with boxes in pixels from 0 at the left and upper edge."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

from vm_embedded.errors import InputError, one_line
from vm_embedded.files import open_regular
from vm_embedded.geometry.lens import Size
from vm_embedded.output.box_files import Edges
from vm_workstation.class_names import class_name

from .annotation import Annotation, Annotations, RawBox
from .findings import BAD_BOX, BAD_FILE, Finding
from .folder_files import FolderFiles, read_bytes
from .image_index import ImageIndex, image_folders, once_each
from .outer_box import outer_box, outer_box_of_turned

_EDGES = ("xmin", "ymin", "xmax", "ymax")
_HEAD = 4096  # bytes in which to look for the root


class _NoDoctype(ElementTree.TreeBuilder):
    """Builds a tree, and refuses the declarations in which entities are defined that expand to gigabytes."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise InputError("has a DOCTYPE, which is not allowed")


def is_voc(files: FolderFiles) -> bool:
    """Whether the folder has an XML file with an annotation, or one for an image."""
    return bool(_xml_files(files, ImageIndex(files)))


def read_voc(files: FolderFiles) -> Annotations:
    """All annotations in Pascal VOC format. An image is found by the file's name, or else by its entry filename."""
    index = ImageIndex(files)
    found, faults, spoiled = [], [], set()
    for path in _xml_files(files, index):
        label = files.label(path)
        images = index.of_stem(path)
        try:
            root = _parse(path)
            image = _image(root, path, images, index)
        except InputError as error:
            spoiled.update(images)
            names = f"; {index.labels(images)} not used" if images else ""
            faults.append(Finding(BAD_FILE, f"{label}: {error}{names}"))
            continue
        boxes, wrong = _boxes(root, label)
        size = None
        try:
            size = _size(root)
        except InputError as error:
            wrong.append(f"{label}: {error}")
        if wrong:
            spoiled.add(image)
            faults += [Finding(BAD_BOX, f"{each}; {files.label(image)} not used") for each in wrong]
            continue
        found.append(Annotation(image, label, tuple(boxes), size))
    once = once_each(files, found)
    return replace(once, faults=(*faults, *once.faults), spoiled=once.spoiled | spoiled)


def _xml_files(files: FolderFiles, index: ImageIndex) -> list[Path]:
    return [path for path in files.with_suffix(".xml") if index.of_stem(path) or _has_annotation(path)]


def _has_annotation(path: Path) -> bool:
    try:
        with open_regular(path) as file:
            return b"<annotation" in file.read(_HEAD).replace(b"\0", b"")
    except OSError:
        return True


def _parse(path: Path) -> ElementTree.Element:
    """The root of an annotation file. Raises InputError without its name."""
    content = read_bytes(path)
    parser = ElementTree.XMLParser(target=_NoDoctype())
    try:
        parser.feed(content)
        root = parser.close()
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"is cut short or not XML ({one_line(error)})") from error
    assert isinstance(root, ElementTree.Element)
    if root.tag != "annotation":
        hint = ": this is CVAT's own format; export as COCO, Pascal VOC or YOLO" if root.tag == "annotations" else ""
        raise InputError(f"begins with <{root.tag}>, not with <annotation>{hint}")
    return root


def _image(root: ElementTree.Element, path: Path, images: list[Path], index: ImageIndex) -> Path:
    """The image of an annotation, given those with its stem. Raises InputError if there is none, or several."""
    name = (root.findtext("filename") or "").strip()
    if len(images) > 1:
        images = [image for image in images if image.name == name] or images
    if len(images) > 1:
        raise InputError(f"may belong to {index.labels(images)}: two images with one name")
    if images:
        return images[0]
    if not name:
        raise InputError("there is no image for it")
    return index.named(name, image_folders(path))


def _size(root: ElementTree.Element) -> Size | None:
    """The stated width and height [px]; None if they are missing or 0. Raises InputError for other texts."""
    values = [(root.findtext(f"size/{name}") or "0").strip() for name in ("width", "height")]
    try:
        width, height = (int(float(value)) for value in values)
    except (ValueError, OverflowError) as error:
        raise InputError(f"size {' x '.join(values)[:60]} is not a width and a height in pixels") from error
    return (width, height) if width and height else None


def _boxes(root: ElementTree.Element, label: str) -> tuple[list[RawBox], list[str]]:
    """The boxes of an annotation, and a line for each malformed one."""
    boxes, faults = [], []
    for number, element in enumerate(root.iterfind("object"), start=1):
        place = f"{label} object {number}"
        try:
            boxes.append(_box(element, place))
        except InputError as error:
            faults.append(f"{place}: {error}")
    return boxes, faults


def _box(element: ElementTree.Element, place: str) -> RawBox:
    text = element.findtext("name") or ""
    if not text.strip():
        raise InputError("class unknown: <name> is missing or empty")
    name = class_name(text)
    try:
        return RawBox(place, name, _edges(element))
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _edges(element: ElementTree.Element) -> Edges:
    """The box of an object, or the outer one of its polygon or oriented box."""
    if element.find("bndbox") is not None:
        left, top, right, bottom = _numbers(element, "bndbox", _EDGES)
        turns = (each for each in element.iterfind("attributes/attribute") if each.findtext("name") == "rotation")
        turn = next(turns, None)
        edges = (left, top, right, bottom)
        return edges if turn is None else outer_box_of_turned(edges, math.radians(*_numbers(turn, ".", ["value"])))
    if element.find("robndbox") is not None:
        x, y, width, height, angle = _numbers(element, "robndbox", ("cx", "cy", "w", "h", "angle"))
        edges = (x - width / 2.0, y - height / 2.0, x + width / 2.0, y + height / 2.0)
        return outer_box_of_turned(edges, angle)
    corners = len(element.findall("polygon/*")) // 2
    if corners < 3:
        raise InputError(f"there is no <bndbox> with {', '.join(_EDGES)}, <robndbox> or <polygon>")
    xs, ys = (_numbers(element, "polygon", [f"{axis}{at}" for at in range(1, corners + 1)]) for axis in "xy")
    return outer_box(zip(xs, ys, strict=True))


def _numbers(element: ElementTree.Element, place: str, names: Iterable[str]) -> list[float]:
    """The numbers in the entries of these names. Raises InputError that begins with the name of one and its text."""
    values = []
    for name in names:
        text = (element.findtext(f"{place}/{name}") or "").strip()
        try:
            values.append(float(text))
        except ValueError as error:
            raise InputError(f"{name} {text[:20]!r} is not a number") from error
    return values
