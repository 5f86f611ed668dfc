"""Positions of pictures in tar shards: with them, each picture is read directly, without unpacking the shard."""

from __future__ import annotations

import tarfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from vm_embedded.errors import InputError, one_line
from vm_embedded.files import open_regular

from .picture_files import IMAGES, PictureFiles, Place
from .tar_members import DAMAGE, TarSource, check_readable, members

PARTS_BY_SUFFIX = {**dict.fromkeys(IMAGES, "image"), ".mask.png": "mask", ".lens.yaml": "lens"}
"""Parts of a picture by suffix; files with other suffixes are ignored."""


def key_and_part(name: str) -> tuple[str, str | None]:
    """The number of a file in a shard, which ends at the first dot of the name, and its part, or None."""
    number, dot, rest = name.rpartition("/")[2].partition(".")
    return number, PARTS_BY_SUFFIX.get((dot + rest).lower())


def find_shards(where: Path) -> list[Path]:
    """Shards of a folder, or of a pattern such as DIR/pictures-*.tar, by name. Raises InputError if there are none."""
    found = where.glob("*.tar") if where.is_dir() else where.parent.glob(where.name)
    shards = sorted(path for path in found if not path.is_dir())
    if not shards:
        raise InputError(f"there are no shards {where / '*.tar' if where.is_dir() else where}")
    return shards


def open_shards(where: Path) -> list[PictureFiles]:
    """All pictures of the shards in a folder or of a pattern, by number.

    It reads only headers. Raises InputError if a shard is damaged, or if two pictures have the same number.
    """
    pictures: dict[str, PictureFiles] = {}
    for shard in find_shards(where):
        for entry in _entries(shard):
            picture = entry.files(shard)
            other = pictures.setdefault(picture.number, picture)
            if other is not picture:
                raise InputError(f"picture {picture.number} is both in {other.shard} and in {shard}")
    if not pictures:
        raise InputError(f"the shards {where} hold no pictures: images must be named X.jpg or X.png")
    return [picture for _, picture in sorted(pictures.items())]


@dataclass
class _Entry:
    """The parts of one picture in a shard: names and places."""

    number: str
    parts: dict[str, tuple[str, Place]] = field(default_factory=dict)

    def files(self, shard: Path) -> PictureFiles:
        usual = {"image": ".jpg", "mask": ".mask.png", "lens": ".lens.yaml"}
        names = {part: self.parts[part][0] if part in self.parts else self.number + usual[part] for part in usual}
        image, mask, lens = (shard / name for name in names.values())
        places = tuple((part, place) for part, (_, place) in self.parts.items())
        return PictureFiles(self.number, image, mask, lens, shard, places)


def _entries(shard: Path) -> Iterator[_Entry]:
    """The pictures of a shard that have an image. Raises InputError naming the shard and the place of any damage."""
    entries: dict[str, _Entry] = {}
    after = "its start"
    try:
        opened = open_regular(shard)
    except OSError as error:
        raise InputError(f"can't read {shard}: {error.strerror or error}") from error
    try:
        with opened as file:
            source = TarSource(file)
            with tarfile.open(fileobj=source, mode="r:") as tar:
                for member in members(tar, source):
                    _add_member(entries, member, shard)
                    after = member.name
            # tarfile accepts a cut file as a complete archive.
            source.seek(tar.offset)
            if source.read(512) != bytes(512):
                raise InputError(f"{shard} is cut short or damaged after {after}, at byte {tar.offset}")
    except DAMAGE as error:
        raise InputError(f"{shard} is cut short or damaged after {after}: {one_line(error)}") from error
    yield from (entry for entry in entries.values() if "image" in entry.parts)


def _add_member(entries: dict[str, _Entry], member: tarfile.TarInfo, shard: Path) -> None:
    """Add a file of a shard to its picture's entry; other members are ignored. Raises InputError for a second file."""
    number, part = key_and_part(member.name)
    if not member.isfile() or part is None:
        return
    check_readable(member)
    entry = entries.setdefault(number, _Entry(number))
    if part in entry.parts:
        raise InputError(f"{shard} has two files for the {part} of picture {number}")
    entry.parts[part] = member.name, Place(member.offset_data, member.size)
