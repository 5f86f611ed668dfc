"""Frames with boxes, lens and pose as a folder of pictures with masks, for the training of a mesh network."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2

from vm_embedded.cameras.image_files import read_image
from vm_embedded.errors import InputError
from vm_embedded.files import atomic_folder, read_bytes
from vm_embedded.geometry.lens_files import read_lens_file

from ..boxes.box import BoxedPicture
from ..data.picture_files import IMAGES
from .box_masks import MaskRule, mask_of


@dataclass(frozen=True)
class ImportedBoxes:
    """numbers: the X of imageX.jpg of each frame; None if it lacks lens or pose. labeled: boxes that became labels.

    misfits: a line for each box that did not.
    """

    numbers: tuple[str | None, ...]
    labeled: int
    misfits: tuple[str, ...]


def import_boxes(
    pictures: Sequence[BoxedPicture], folder: Path, out: Path, rule: MaskRule, write_radius: bool
) -> ImportedBoxes:
    """Write imageX, maskX.png and lensX.yaml of each frame that has a lens file with a pose.

    folder: that the frames are in. write_radius: also write sceneX.json with the objects' radius, for networks that are
    trained on objects of many radii. Raises InputError if `out` is not empty or can't be written; after an error
    or an interrupt, it is as before.
    """
    _check_new(out)
    numbers: list[str | None] = []
    misfits: list[str] = []
    labeled = 0
    with atomic_folder(out) as part:
        for picture in pictures:
            lens = None if picture.lens is None else read_lens_file(picture.lens)
            if picture.lens is None or lens is None or lens.orientation is None:
                numbers.append(None)
                continue
            number = _number(picture.image.relative_to(folder), numbers)
            mask, count, wrong = mask_of(picture, lens, rule)
            contents = {
                f"mask{number}.png": cv2.imencode(".png", mask)[1].tobytes(),
                f"lens{number}.yaml": read_bytes(picture.lens),
                f"image{number}{_suffix(picture.image)}": _image(picture.image),
            }
            if write_radius:
                contents[f"scene{number}.json"] = (json.dumps({"ball_radius": rule.shape.radius}) + "\n").encode()
            for name, content in contents.items():
                (part / name).write_bytes(content)
            numbers.append(number)
            labeled += count
            misfits += [f"{picture.image.relative_to(folder)}: {each}" for each in wrong]
    return ImportedBoxes(tuple(numbers), labeled, tuple(misfits))


def _check_new(out: Path) -> None:
    """Raise InputError before long work if a folder can't be written, or holds anything."""
    try:
        if out.exists() and any(out.iterdir()):
            raise InputError(f"{out} is not empty: give a new folder")
    except OSError as error:
        raise InputError(f"can't write to folder {out}: {error.strerror or error}") from error


def _number(path: Path, used: Sequence[str | None]) -> str:
    """The path of a frame as a picture's number: without separators, dots and the signs of comments in lists of
    pictures, and different from all used ones."""
    number = "_".join(path.with_suffix("").parts).replace(".", "_").replace("#", "_")
    while number in used:
        number += "_"
    return number


def _suffix(image: Path) -> str:
    """The suffix of an image's copy: .png for a format that vm-train does not read."""
    suffix = image.suffix.lower()
    return suffix if suffix in IMAGES else ".png"


def _image(image: Path) -> bytes:
    """An image without any change, or as PNG if vm-train does not read its format. Raises InputError."""
    if image.suffix.lower() in IMAGES:
        return read_bytes(image)
    return cv2.imencode(".png", read_image(image))[1].tobytes()
