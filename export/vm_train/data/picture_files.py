"""The files of pictures, in a folder or in tar shards: imageX.jpg or .png, maskX.png, lensX.yaml."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from vm_embedded.errors import InputError
from vm_embedded.files import exists, open_regular, read_regular

IMAGES = (".jpg", ".jpeg", ".png")

PARTS = ("image", "mask", "lens")

LARGEST_FILE = 2**28
"""Most bytes of one of a picture's files. A mask of 50 Mpx has 200 MB before it is compressed."""


class PictureFault(InputError):
    """A picture can't be used. kind: of the fault, one of missing, damaged, size, lens and color."""

    def __init__(self, text: str, kind: str = "damaged") -> None:
        super().__init__(text)
        self.kind = kind


class RawPicture(NamedTuple):
    """The content of a picture's files: bytes of image and mask, text of the lens file."""

    number: str
    image: bytes
    mask: bytes
    lens: str


class Place(NamedTuple):
    """Position and size of a file in a shard [bytes]."""

    offset: int
    size: int


@dataclass(frozen=True)
class PictureFiles:
    """The files of one picture.

    number: the X of imageX.jpg. shard: the tar file that holds them, or None for separate files. places: positions in
    the shard, by part, for the parts that it holds.
    """

    number: str
    image: Path
    mask: Path
    lens: Path
    shard: Path | None = None
    places: tuple[tuple[str, Place], ...] = ()

    @property
    def scene(self) -> Path:
        """The path of the picture's scene file, if vm-synth made it; shards hold none."""
        return (self.shard or self.image).with_name(f"scene{self.number}.json")

    def path(self, part: str) -> Path:
        """The path of a part, or its name inside the shard."""
        return {"image": self.image, "mask": self.mask, "lens": self.lens}[part]

    def place(self, part: str) -> Place | None:
        """The place of a part in the shard; None if it is missing."""
        return dict(self.places).get(part)

    def size(self, part: str) -> int | None:
        """Size of one of PARTS [bytes]; None if it is missing."""
        if self.shard is None:
            path = self.path(part)
            return path.stat().st_size if exists(path) else None
        place = self.place(part)
        return None if place is None else place.size

    def read(self, part: str) -> bytes:
        """The bytes of one of PARTS. Raises PictureFault naming the file."""
        path = self.path(part)
        try:
            return read_regular(path, LARGEST_FILE) if self.shard is None else self._read_shard(self.shard, part)
        except FileNotFoundError as error:
            raise PictureFault(f"{path.name}: is missing", "missing") from error
        except OSError as error:
            raise PictureFault(f"{path.name}: can't be read: {error.strerror or error}") from error

    def _read_shard(self, shard: Path, part: str) -> bytes:
        place = self.place(part)
        if place is None:
            raise FileNotFoundError
        with open_regular(shard) as file:
            file.seek(place.offset)
            data = file.read(place.size)
        if len(data) != place.size:
            raise PictureFault(f"{self.path(part).name}: {shard} is cut short there")
        return data

    def raw(self) -> RawPicture:
        """The content of all parts. Raises PictureFault naming the file."""
        image, mask, lens = (self.read(part) for part in PARTS)
        try:
            return RawPicture(self.number, image, mask, lens.decode("utf-8"))
        except UnicodeDecodeError as error:
            raise PictureFault(f"{self.lens.name}: is not UTF-8 text", "lens") from error


def paths_of(pictures: Iterable[PictureFiles]) -> Iterator[Path]:
    """The files that hold pictures: shards, or image, mask and lens of each."""
    for each in pictures:
        yield from (each.path(part) for part in PARTS) if each.shard is None else (each.shard,)
