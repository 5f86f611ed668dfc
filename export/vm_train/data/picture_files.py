"""The files of pictures in a folder: imageX.jpg or .png, maskX.png, lensX.yaml, and perhaps sceneX.json."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from vm_embedded.errors import InputError
from vm_embedded.files import read_regular

IMAGES = (".jpg", ".jpeg", ".png")

PARTS = ("image", "mask", "lens")
"""Files that each picture needs. vm-synth adds a scene file."""

_SUFFIXES = {"image": IMAGES, "mask": (".png",), "lens": (".yaml",), "scene": (".json",)}

LARGEST_FILE = 2**28
"""Most bytes of one of a picture's files. A mask of 50 Mpx has 200 MB before it is compressed."""


class PictureFault(InputError):
    """A picture can't be used. kind: of the fault, one of missing, damaged, size, lens and color."""

    def __init__(self, text: str, kind: str = "damaged") -> None:
        super().__init__(text)
        self.kind = kind


class FileName(NamedTuple):
    """The name of a file: one of _SUFFIXES, the picture's number, and the suffix in small letters."""

    part: str
    number: str
    suffix: str


def parse_name(name: str) -> FileName | None:
    """The parts of a file's name; None if it is not a file of a picture."""
    stem, dot, end = name.rpartition(".")
    suffix = dot + end.lower()
    for part, suffixes in _SUFFIXES.items():
        if stem.startswith(part) and suffix in suffixes:
            return FileName(part, stem.removeprefix(part), suffix)
    return None


@dataclass(frozen=True)
class PictureFiles:
    """The files of one picture. number: the X of imageX.jpg."""

    number: str
    image: Path
    mask: Path
    lens: Path

    @property
    def scene(self) -> Path:
        """The path of the picture's scene file, which vm-synth makes."""
        return self.image.with_name(f"scene{self.number}.json")

    def path(self, part: str) -> Path:
        """The path of a part."""
        return {"image": self.image, "mask": self.mask, "lens": self.lens}[part]

    def read(self, part: str) -> bytes:
        """The bytes of one of PARTS. Raises PictureFault naming the file."""
        path = self.path(part)
        try:
            return read_regular(path, LARGEST_FILE)
        except FileNotFoundError as error:
            raise PictureFault(f"{path.name}: is missing", "missing") from error
        except OSError as error:
            raise PictureFault(f"{path.name}: can't be read: {error.strerror or error}") from error


def paths_of(pictures: Iterable[PictureFiles]) -> Iterator[Path]:
    """Image, mask and lens of each picture."""
    for each in pictures:
        yield from (each.path(part) for part in PARTS)
