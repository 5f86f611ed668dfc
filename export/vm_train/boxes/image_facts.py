"""Image files as annotation tools show them: their size, and the turn that their EXIF entry asks for."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vm_embedded.arrays import Image
from vm_embedded.cameras.decoding import decode
from vm_embedded.errors import InputError
from vm_embedded.files import read_regular
from vm_embedded.geometry.lens import Size

UPRIGHT = 1
"""The EXIF orientation of an image that is stored upright."""


@dataclass(frozen=True)
class ImageFacts:
    """Facts about an image file.

    stored: width and height as stored [px]. orientation: EXIF orientation, from 1 to 8; 1 is upright. digest: equal for
    files of equal content.
    """

    stored: Size
    orientation: int
    digest: bytes

    @property
    def size(self) -> Size:
        """Width and height after the turn [px]."""
        return self.stored[::-1] if self.orientation >= 5 else self.stored


def read_upright(path: Path) -> Image:
    """An image file as BGR (h, w, 3), turned as its EXIF entry says. Raises InputError if it is missing or broken."""
    try:
        return turned(decode(_content(path)), _orientation(path))
    except InputError as error:
        raise InputError(f"{path} {error}") from error


def turned(image: Image, orientation: int) -> Image:
    """An image as stored (h, w, 3), after the turn of its EXIF orientation."""
    if orientation >= 5:
        image = image.transpose(1, 0, 2)
    if orientation in (2, 3, 6, 7):
        image = image[:, ::-1]
    if orientation in (3, 4, 7, 8):
        image = image[::-1]
    return np.ascontiguousarray(image)


def image_facts(path: Path) -> ImageFacts:
    """Facts about an image file. Raises InputError without its name if it is missing or broken."""
    content = _content(path)
    height, width = decode(content).shape[:2]
    return ImageFacts((width, height), _orientation(path), hashlib.sha256(content).digest())


def _content(path: Path) -> bytes:
    try:
        return read_regular(path)
    except OSError as error:
        raise InputError(f"can't be read: {error.strerror or error}") from error


def _orientation(path: Path) -> int:
    """The EXIF orientation of an image that OpenCV can read; 1 if Pillow finds none."""
    from PIL import ExifTags
    from PIL import Image as Pillow

    try:
        with Pillow.open(path) as image:
            found = image.getexif().get(ExifTags.Base.Orientation, UPRIGHT)
    except (OSError, ValueError, SyntaxError):
        return UPRIGHT
    return found if found in range(1, 9) else UPRIGHT
