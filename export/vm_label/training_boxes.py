"""Writing judged boxes as training data: a folder of images with boxes in YOLO format.

A training takes every place without a box as background. So it gets only images of which all crops were answered with
yes or no, or replaced by a drawn box, and images without a crop of which a person said that they show no object.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from vm_embedded.cameras.image_files import lens_file_of
from vm_embedded.errors import InputError
from vm_embedded.files import atomic_folder, read_bytes, real_path
from vm_embedded.output.box_files import CLASSES, OBJECT, yolo_line

from .box_folder import BoxFolder
from .crops import Crop, replaced, whole_picture


@dataclass(frozen=True)
class Written:
    """What was written and left out, in images. boxes: number of accepted boxes by class. background: written images
    without a box. open, skipped: left out because of crops without an answer, and of skipped ones. empty: left out
    because they have no crop and nobody answered. faulty: left out because not all of their boxes can be read."""

    images: int
    boxes: Mapping[str, int]
    background: int
    open: int
    skipped: int
    empty: int
    faulty: int


def write_training_boxes(folder: BoxFolder, answers: Mapping[str, str], target: Path, empty: bool = False) -> Written:
    """Write images, NAME.txt, classes.txt and lens files to a new folder, which keeps the folders of the images.

    answers: by crop, oldest first. empty: also write images without a crop and without an answer, as background.

    Raises InputError if the target has files or lies in the folder of boxes, or if it can't be written; then it is as
    before.
    """
    _check_target(folder.path, target)
    by_image: dict[str, list[Crop]] = defaultdict(list)
    gone = replaced(folder.crops, answers)
    for crop in folder.crops:
        if crop.id not in gone:
            by_image[crop.image].append(crop)
    fates = {image: _fate(folder, by_image[image], image, answers) for image in folder.images}
    chosen = [image for image, fate in fates.items() if fate == "written" or (empty and fate == "empty")]
    if not chosen:
        raise InputError(f"no image of {folder.path} has an answer for each of its crops; judge them on the page first")
    accepted = {image: [crop for crop in by_image[image] if answers[crop.id] == "yes"] for image in chosen}
    with atomic_folder(target) as part:
        for image, crops in accepted.items():
            _write_image(folder, part, image, crops)
    count = Counter(fates.values())
    return Written(
        images=len(chosen),
        boxes=Counter(crop.class_name for crops in accepted.values() for crop in crops),
        background=sum(not crops for crops in accepted.values()),
        open=count["open"],
        skipped=count["skipped"],
        empty=0 if empty else count["empty"],
        faulty=count["faulty"],
    )


def _fate(folder: BoxFolder, crops: list[Crop], image: str, answers: Mapping[str, str]) -> str:
    """Whether an image is written, or why it is left out."""
    about_all = answers.get(whole_picture(image, folder.classes).id)
    given = [answers.get(crop.id) for crop in crops]
    if not crops and about_all in ("no", "skip"):
        given = [about_all]
    if image in folder.faulty:
        return "faulty"
    if not given:
        return "empty"
    if None in given:
        return "open"
    return "skipped" if "skip" in given else "written"


def _check_target(source: Path, target: Path) -> None:
    """Raise InputError unless a folder can be written: a new or empty one, outside of the folder of boxes."""
    try:
        real = real_path(target)
        if real_path(source) in (real, *real.parents):
            raise InputError(f"can't write {target}: it lies in the folder of boxes, {source}")
        if target.exists() and any(target.iterdir()):
            raise InputError(f"can't write {target}: the folder is not empty; give a new one")
    except OSError as error:
        raise InputError(f"can't write {target}: {error.strerror or error}") from error


def _write_image(folder: BoxFolder, target: Path, image: str, crops: list[Crop]) -> None:
    """Write an image with its boxes, its lens file if it has one, and classes and object.toml beside it. Raises
    InputError or OSError."""
    source, copy = folder.path / image, target / image
    copy.parent.mkdir(parents=True, exist_ok=True)
    copy.write_bytes(read_bytes(source))
    lens = lens_file_of(source)
    if lens is not None:
        copy.with_name(lens.name).write_bytes(read_bytes(lens))
    shape = source.with_name(OBJECT)
    if shape.exists():
        copy.with_name(OBJECT).write_bytes(read_bytes(shape))
    numbers = {name: number for number, name in enumerate(folder.classes)}
    lines = [yolo_line(numbers[crop.class_name], crop.shares) for crop in crops]
    copy.with_suffix(".txt").write_text("".join(lines), encoding="utf-8")
    classes = copy.with_name(CLASSES)
    if not classes.exists():
        classes.write_text("".join(f"{name}\n" for name in folder.classes), encoding="utf-8")
