"""Pictures of a data set: imageX.jpg or .png, maskX.png and lensX.yaml, the names of the reference and of vm-synth."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from vm_embedded.arrays import Image
from vm_embedded.cameras.decoding import decode_as
from vm_embedded.errors import GeometryError, InputError
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.lens_files import LensFile, parse_lens_yaml
from vm_embedded.geometry.orientation import Orientation

from .classes import Classes, Labels
from .picture_files import PARTS, PictureFault, PictureFiles, parse_name

_LENSES_KEPT = 1 << 14


@dataclass(frozen=True)
class Picture:
    """One picture: BGR image (h, w, 3), labels (h, w), and its lens file, which has an orientation."""

    image: Image
    labels: Labels
    lens: LensFile

    @property
    def size(self) -> Size:
        """Width and height [px]."""
        height, width = self.labels.shape
        return width, height

    @property
    def orientation(self) -> Orientation:
        """The camera's height and attitude."""
        assert self.lens.orientation is not None  # read_picture refuses pictures without
        return self.lens.orientation

    @property
    def fitted_lens(self) -> Lens:
        """The lens for an image of this size. Raises InputError if it does not fit."""
        return self.lens.lens.for_image(self.size)


def find_pictures(folder: Path) -> list[PictureFiles]:
    """All pictures of a folder, by number.

    Raises InputError if there are none, or if two pictures have the same number.
    """
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}")
    names = sorted(entry.name for entry in os.scandir(folder))
    parts: dict[str, dict[str, str]] = {"image": {}, "mask": {}, "lens": {}, "scene": {}}
    for name in names:
        found = parse_name(name)
        if found is not None and (before := parts[found.part].setdefault(found.number, name)) != name:
            raise InputError(
                f"{folder} has {before} and {name}: two files for the {found.part} of one picture: remove one of them"
            )
    if not parts["image"]:
        hint = "for images with boxes, vm-train has --boxes"
        if any(name.startswith("image") for name in names):
            hint = "the image* files in it have another suffix"
        elif archives := [name for name in names if ".tar" in name]:
            hint = f"unpack the archives with vm-train import {folder / archives[0]} OUT"
        raise InputError(f"no pictures in {folder}: images must be named imageX.jpg or imageX.png; {hint}")
    return [
        PictureFiles(
            number,
            folder / name,
            folder / parts["mask"].get(number, f"mask{number}.png"),
            folder / parts["lens"].get(number, f"lens{number}.yaml"),
        )
        for number, name in sorted(parts["image"].items())
    ]


def read_picture(files: PictureFiles, classes: Classes) -> Picture:
    """Read a picture. Raises PictureFault, an InputError, naming the file and its fault."""
    contents = [files.read(part) for part in PARTS]
    image = _decoded(contents[0], files.image.name, cv2.IMREAD_COLOR)
    mask = _decoded(contents[1], files.mask.name, cv2.IMREAD_UNCHANGED)
    if mask.ndim != 3 or mask.shape[2] not in (3, 4) or mask.dtype != np.uint8:
        channels = mask.shape[2] if mask.ndim == 3 else 1
        found = f"{channels} channel{'s' * (channels > 1)} of {8 * mask.itemsize} bits"
        raise PictureFault(f"{files.mask.name}: a mask must have 3 or 4 channels of 8 bits, not {found}", "color")
    if mask.shape[:2] != image.shape[:2]:
        sizes = (f"{each.shape[1]} x {each.shape[0]}" for each in (mask, image))
        raise PictureFault(f"{files.mask.name}: {' px, but the image is '.join(sizes)} px", "size")
    lens = parse_lens(contents[2], files.lens.name)
    if lens.orientation is None:
        raise PictureFault(f"{files.lens.name}: lacks Hoc, the camera's height and orientation", "lens")
    try:
        lens.lens.for_image((image.shape[1], image.shape[0]))
    except InputError as error:
        raise PictureFault(f"{files.lens.name}: {error}", "lens") from error
    try:
        return Picture(image, classes.labels(mask), lens)
    except PictureFault as error:
        raise PictureFault(f"{files.mask.name}: {error}", error.kind) from error


def _decoded(data: bytes, name: str, how: int) -> Image:
    try:
        return decode_as(data, how)  # type: ignore[return-value]  # the caller checks the type of a mask's values
    except InputError as error:
        raise PictureFault(f"{name}: {error}") from error


def parse_lens(content: bytes, name: str) -> LensFile:
    """The content of a lens file, parsed once in each process. Raises PictureFault that begins with `name`."""
    try:
        return _lens(content.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise PictureFault(f"{name}: is not UTF-8 text", "lens") from error
    except InputError as error:
        raise PictureFault(f"{name}: {error}", "lens") from error


@lru_cache(_LENSES_KEPT)
def _lens(text: str) -> LensFile:
    try:
        return parse_lens_yaml(text)
    except GeometryError as error:
        raise InputError(str(error)) from error
