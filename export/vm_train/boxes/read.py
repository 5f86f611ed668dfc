"""Reads a folder of annotated images in any of the formats, and checks all of it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from vm_embedded.cameras.image_files import lens_file_of
from vm_embedded.errors import InputError, unknown
from vm_embedded.geometry.lens_files import read_lens_file
from vm_workstation.yolo_labels import yolo_files

from .annotation import Annotation, Annotations
from .box import BoxedPicture, BoxedSet
from .checked_boxes import CheckedBoxes, checked_boxes
from .coco import is_coco, read_coco
from .coco_file import coco_files
from .findings import BAD_BOX, BAD_IMAGE, BAD_LENS, NO_ANNOTATION, NO_NAME, SAME_IMAGE, Finding
from .fit import fit
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
