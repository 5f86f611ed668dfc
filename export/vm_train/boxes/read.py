"""Reads a folder of annotated images in any of the formats, and checks all of it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from vm_embedded.cameras.exif import UPRIGHT
from vm_embedded.cameras.image_files import lens_file_of
from vm_embedded.errors import InputError, unknown
from vm_embedded.geometry.lens import Size
from vm_embedded.geometry.lens_files import read_lens_file
from vm_workstation.yolo_labels import yolo_files

from .annotation import Annotation, Annotations, RawBox
from .box import BoxedPicture, BoxedSet
from .checked_boxes import CheckedBoxes, checked_boxes
from .coco import is_coco, read_coco
from .coco_file import coco_files
from .findings import BAD_BOX, BAD_IMAGE, BAD_LENS, NO_ANNOTATION, NO_NAME, SAME_IMAGE, TURNED, Finding
from .folder_files import FolderFiles, find_files
from .image_facts import ImageFacts, image_facts
from .recordings import recordings
from .voc import is_voc, read_voc
from .yolo import is_yolo, read_yolo

FORMATS = {"yolo": (is_yolo, read_yolo), "voc": (is_voc, read_voc), "coco": (is_coco, read_coco)}
"""For each format: whether a folder has it, and its reader."""

_ANNOTATIONS = ("annotations", "Annotations")
"""Folders that Pascal VOC and COCO have beside that of the images."""


def read_boxes(
    folder: Path,
    format: str | None = None,
    names: Mapping[str, str] | None = None,
    round_names: Collection[str] = ("ball",),
) -> BoxedSet:
    """All images of a folder and its sub-folders that have good annotations, and all faults and remarks.

    Every place without a box counts as background. So an image is left out if one of its boxes can't be read.

    format: one of FORMATS; None finds it out. names: for names of classes in the annotations, the names to use; others
    stay as they are. round_names: classes, after this renaming, of which a long box gets a remark. Raises InputError if
    the folder has no images, no annotations, or those of several formats, and for an unknown format.
    """
    files = find_files(folder)
    annotations = FORMATS[_format(files, format)][1](files)
    pictures, findings = _checked(files, annotations, names or {}, round_names)
    findings += _unmapped(annotations, names or {})
    found = sorted({box.name for picture in pictures for box in picture.boxes})
    return BoxedSet(tuple(pictures), tuple(findings), tuple(found))


def files_in(folder: Path) -> Iterator[Path]:
    """The files that `read_boxes` may read: all below a folder but JSON files of other programs, and labels beside it.

    Raises InputError as `find_files` does.
    """
    files = find_files(folder)
    yield from files.images
    yield from (each for each in files.others if each.suffix.lower() != ".json")
    yield from coco_files(files)
    yield from yolo_files(files.images)


def _format(files: FolderFiles, format: str | None) -> str:
    """The format to read. Raises InputError if the folder does not have it, or has several."""
    if format is not None and format not in FORMATS:
        raise InputError(unknown("format", format, FORMATS))
    found = [name for name, (is_there, _) in FORMATS.items() if is_there(files)]
    if not found:
        above = files.folder.parent
        beside = next((each for each in _ANNOTATIONS if (above / each).is_dir()), None)
        hint = f"; for those in {beside} beside it, give {above}" if beside else ""
        raise InputError(
            f"no annotations in {files.folder}: expected YOLO (NAME.txt), Pascal VOC (NAME.xml) or COCO (.json with "
            f"images, annotations and categories){hint}"
        )
    if format is None and len(found) > 1:
        raise InputError(
            f"{files.folder} has annotations in several formats, {', '.join(found)}: choose one with --format"
        )
    if format is not None and format not in found:
        raise InputError(f"no annotations in format {format} in {files.folder}; it has {', '.join(found)}")
    return format or found[0]


def _checked(
    files: FolderFiles, annotations: Annotations, names: Mapping[str, str], round_names: Collection[str]
) -> tuple[list[BoxedPicture], list[Finding]]:
    """The good pictures in the order of their paths, and all faults and remarks."""
    by_image = {each.image: each for each in annotations.found}
    groups = recordings([path.relative_to(files.folder) for path in files.images])
    pictures: list[BoxedPicture] = []
    findings = list(annotations.faults)
    first: dict[bytes, Path] = {}
    for path, recording in zip(files.images, groups, strict=True):
        if path in annotations.spoiled or (path not in by_image and not annotations.complete):
            continue
        label = files.label(path)
        if path not in by_image:
            text = f"{label}: no annotation names it; an image that shows nothing needs an empty one; not used"
            findings.append(Finding(NO_ANNOTATION, text))
            continue
        try:
            facts = image_facts(path)
            same = first.setdefault(facts.digest, path)
            if same != path:
                findings.append(Finding(SAME_IMAGE, f"{label}: the same image as {files.label(same)}; not used"))
                continue
            boxes = _boxes(by_image[path], facts, label, names, round_names)
        except InputError as error:
            findings.append(Finding(BAD_IMAGE, f"{label}: {error}; not used"))
            continue
        findings += boxes.findings
        if boxes.unusable:
            findings += [Finding(BAD_BOX, f"{each}; {label} not used") for each in boxes.unusable]
            continue
        lens, wrong = _lens(files, path, facts)
        pictures.append(BoxedPicture(path, facts.size, tuple(boxes.good), recording, lens))
        findings += wrong
    return pictures, findings


def _boxes(
    annotation: Annotation, facts: ImageFacts, label: str, names: Mapping[str, str], round_names: Collection[str]
) -> CheckedBoxes:
    """The boxes of an image in its upright pixels. Raises InputError for a wrong size."""
    raw, remarks = fit(annotation, facts, label)
    renamed = [replace(each, name=names.get(each.name, each.name)) for each in raw]
    checked = checked_boxes(renamed, facts.size, round_names)
    return replace(checked, findings=remarks + checked.findings)


def _lens(files: FolderFiles, image: Path, facts: ImageFacts) -> tuple[Path | None, list[Finding]]:
    """The good lens file beside an image, if there is one, and what is wrong with it."""
    path = lens_file_of(image)
    if path is None:
        return None, []
    try:
        read_lens_file(path).lens.for_image(facts.size)
    except InputError as error:
        text = f"{files.label(path)}: {error}; {files.label(image)} is used without lens"
        return None, [Finding(BAD_LENS, text)]
    return path, []


def _unmapped(annotations: Annotations, names: Mapping[str, str]) -> list[Finding]:
    """A fault for each name to map that no annotation has."""
    there = sorted({box.name for each in annotations.found for box in each.boxes})
    return [
        Finding(NO_NAME, f"no box to rename to {names[name]}: {unknown('class', name, there)}")
        for name in names
        if name not in there
    ]


def fit(annotation: Annotation, facts: ImageFacts, label: str) -> tuple[list[RawBox], list[Finding]]:
    """The boxes of an image in its upright pixels, with edges from 0 to width and height, and remarks.

    If the annotation states the size as stored, and the turn swaps width and height, its boxes are turned with the
    image. If both sizes are equal or it states none, they are taken as drawn on the upright image. label: of the image,
    for messages. Raises InputError if the stated size is another one.
    """
    turn, size = facts.orientation != UPRIGHT, facts.size
    stated = annotation.size
    as_stored = turn and stated == facts.stored and stated != size
    if stated is not None and stated != size and not as_stored:
        allowed = f"{_px(size)}, or {_px(facts.stored)} without its EXIF turn" if turn else _px(size)
        raise InputError(f"{annotation.file} states a size of {_px(stated)}, but the image has {allowed}")
    boxes = [_scaled(box, size) for box in annotation.boxes] if annotation.shares else list(annotation.boxes)
    if not turn or (stated == size and size != facts.stored):
        return boxes, []
    about = f"{label}: turned by its EXIF orientation {facts.orientation}"
    if as_stored:
        turned = [_turned(box, facts) for box in boxes]
        text = f"{about}, but {annotation.file} states the size as stored, {_px(facts.stored)}: boxes turned"
        return turned, [Finding(TURNED, text, is_fault=False)]
    where = "does not state" if stated is None else "leaves open"
    text = f"{about}; {annotation.file} {where} whether its boxes are: taken as drawn on the turned image"
    return boxes, [Finding(TURNED, text, is_fault=False)]


def _px(size: Size) -> str:
    return f"{size[0]} x {size[1]} px"


def _scaled(box: RawBox, size: Size) -> RawBox:
    left, top, right, bottom = box.edges
    return replace(box, edges=(left * size[0], top * size[1], right * size[0], bottom * size[1]))


def _turned(box: RawBox, facts: ImageFacts) -> RawBox:
    """A box on the image as stored, on the upright image."""
    left, top, right, bottom = box.edges
    if facts.orientation >= 5:
        left, top, right, bottom = top, left, bottom, right
    width, height = facts.size
    if facts.orientation in (2, 3, 6, 7):
        left, right = width - right, width - left
    if facts.orientation in (3, 4, 7, 8):
        top, bottom = height - bottom, height - top
    return replace(box, edges=(left, top, right, bottom))
