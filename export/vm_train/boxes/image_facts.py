"""Facts about image files: their size, and the turn that their EXIF entry asks for."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from vm_embedded.cameras.decoding import decode
from vm_embedded.cameras.exif import orientation_of
from vm_embedded.errors import InputError
from vm_embedded.files import read_regular
from vm_embedded.geometry.lens import Size


@dataclass(frozen=True)
class ImageFacts:
    """Facts about an image file.

    size: width and height after the turn [px]. orientation: EXIF orientation, from 1 to 8; 1 is upright. digest: equal
    for files of equal content.
    """

    size: Size
    orientation: int
    digest: bytes

    @property
    def stored(self) -> Size:
        """Width and height as stored [px]."""
        return self.size[::-1] if self.orientation >= 5 else self.size


def image_facts(path: Path) -> ImageFacts:
    """Facts about an image file. Raises InputError without its name if it is missing or broken."""
    try:
        content = read_regular(path)
    except OSError as error:
        raise InputError(f"can't be read: {error.strerror or error}") from error
    height, width = decode(content).shape[:2]
    return ImageFacts((width, height), orientation_of(content), hashlib.sha256(content).digest())
