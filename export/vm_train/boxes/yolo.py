"""Annotations in YOLO format: a label file for each image, with boxes as shares of the image."""

from __future__ import annotations

from pathlib import Path

from vm_embedded.errors import InputError
from vm_embedded.files import read_text
from vm_embedded.output.box_files import CLASSES, edges
from vm_workstation.yolo_labels import find_labels, parse_labels
from vm_workstation.yolo_names import NameTables

from .annotation import Annotation, Annotations, RawBox
from .findings import BAD_BOX, BAD_FILE, NO_IMAGE, SEVERAL, Finding
from .folder_files import FolderFiles


def is_yolo(files: FolderFiles) -> bool:
    """Whether an image has a label file, or a text file looks like one."""
    return any(find_labels(image) for image in files.images) or any(map(_has_boxes, files.with_suffix(".txt")))


def read_yolo(files: FolderFiles) -> Annotations:
    """All annotations in YOLO format. Boxes are named by the table of names, or else by their number.

    Raises InputError for an unusable table of names.
    """
    tables = NameTables(files.folder)
    found, faults, spoiled, used = [], [], set(), set()
    for images in files.images_by_key().values():
        path = find_labels(images[0])
        if path is None:
            continue
        used.add(path)
        label, names = files.label(path), tables.of(path.parent)
        if len(images) > 1:
            labels = " and ".join(files.label(each) for each in images)
            text = f"{labels}: two images with one name; {label} may belong to either; not used"
            faults.append(Finding(SEVERAL, text))
            spoiled.update(images)
            continue
        try:
            boxes, wrong = parse_labels(read_text(path), names)
        except InputError as error:
            faults.append(Finding(BAD_FILE, f"{error}; {files.label(images[0])} not used"))
            spoiled.add(images[0])
            continue
        if wrong:
            faults += [Finding(BAD_BOX, f"{label} {fault}; {files.label(images[0])} not used") for fault in wrong]
            spoiled.add(images[0])
            continue
        raw = tuple(RawBox(f"{label} line {each.line}", each.class_name, edges(each.shares)) for each in boxes)
        found.append(Annotation(images[0], label, raw, shares=True))
    strays = [path for path in files.with_suffix(".txt") if path.absolute() not in used and _has_boxes(path)]
    faults += [Finding(NO_IMAGE, f"{files.label(path)}: there is no image for it") for path in strays]
    return Annotations(tuple(found), tuple(faults), frozenset(spoiled))


def _has_boxes(path: Path) -> bool:
    """Whether a text file looks like a label file: its first line with content has a good box."""
    if path.name == CLASSES:
        return False
    try:
        first = read_text(path).lstrip().partition("\n")[0]
    except InputError:
        return False
    return bool(parse_labels(first, ())[0])
