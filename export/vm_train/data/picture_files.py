"""The files of pictures, in a folder or in tar shards: imageX.jpg or .png, maskX.png, lensX.yaml."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from vm_embedded.errors import InputError

IMAGES = (".jpg", ".jpeg", ".png")

PARTS = ("image", "mask", "lens")


class PictureFault(InputError):
    """A picture that can't be used. kind: what is wrong: missing, damaged, size, lens or color."""

    def __init__(self, text: str, kind: str = "damaged") -> None:
        super().__init__(text)
        self.kind = kind


class RawPicture(NamedTuple):
    """A picture as its files have it: bytes of image and mask, text of the lens file."""

    number: str
    image: bytes
    mask: bytes
    lens: str


class Place(NamedTuple):
    """Where a file lies in a shard [bytes]."""

    offset: int
    size: int


@dataclass(frozen=True)
class PictureFiles:
    """The files of one picture.

    number: X of their names. shard: the tar that holds them, or None for files of their own. places: where in it, by
    part; parts that it lacks are left out.
    """

    number: str
    image: Path
    mask: Path
    lens: Path
    shard: Path | None = None
    places: tuple[tuple[str, Place], ...] = ()

    def path(self, part: str) -> Path:
        """A part's file, or its name in the shard."""
        return {"image": self.image, "mask": self.mask, "lens": self.lens}[part]

    def place(self, part: str) -> Place | None:
        """Where a part is in the shard, or None if it is not there."""
        return dict(self.places).get(part)

    def read(self, part: str) -> bytes:
        """The bytes of one of PARTS. Raises PictureFault naming the file."""
        path = self.path(part)
        try:
            return path.read_bytes() if self.shard is None else self._read_shard(self.shard, part)
        except FileNotFoundError as error:
            raise PictureFault(f"{path.name}: is missing", "missing") from error
        except OSError as error:
            raise PictureFault(f"{path.name}: can't be read: {error.strerror or error}") from error

    def _read_shard(self, shard: Path, part: str) -> bytes:
        place = self.place(part)
        if place is None:
            raise FileNotFoundError
        with shard.open("rb", buffering=0) as file:
            file.seek(place.offset)
            data = file.read(place.size)
        if len(data) != place.size:
            raise PictureFault(f"{self.path(part).name}: {shard} is cut short there")
        return data

    def raw(self) -> RawPicture:
        """All parts. Raises PictureFault naming the file."""
        image, mask, lens = (self.read(part) for part in PARTS)
        try:
            return RawPicture(self.number, image, mask, lens.decode("utf-8"))
        except UnicodeDecodeError as error:
            raise PictureFault(f"{self.lens.name}: is no text", "lens") from error
