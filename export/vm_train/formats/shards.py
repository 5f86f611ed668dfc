"""Writing pictures as tar shards in webdataset's form, for data sets that outgrow a disk or come over a network.

A shard holds NUMBER.jpg or .png, NUMBER.mask.png and NUMBER.lens.yaml of each picture, byte for byte as they are in the
folder. The same pictures give the same bytes. shards.json identifies the pictures; with it, a run that was stopped can
continue, and a folder never mixes the shards of two data sets.
"""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from vm_embedded.errors import InputError
from vm_embedded.files import atomic_write, read_regular, write_file

from ..data.picture_files import PARTS, PictureFault, PictureFiles

_FORMAT = 1
"""Version of shards.json."""


def write_shards(pictures: Sequence[PictureFiles], out: Path, per_shard: int, report: Callable[[], None]) -> list[Path]:
    """Write pictures as out/pictures-000000.tar and so on, except the shards that are there already.

    report: is called after each picture. Returns the paths of all shards. Raises InputError for a file that can't be
    read or written, for a number with a dot, and for a folder that holds shards of other pictures. A picture that lacks
    a file is found before anything is written.
    """
    for picture in pictures:
        if "." in picture.number or not picture.number:
            raise InputError(f"picture {picture.number!r} can't go into a shard: its number must have no dot")
        for part in PARTS:
            if picture.size(part) is None:
                reason = "is missing; vm-train check lists all damaged pictures"
                raise PictureFault(f"{picture.path(part).name}: {reason}", "missing")
    _prepare(out, pictures, per_shard)
    shards = []
    for position, start in enumerate(range(0, len(pictures), per_shard)):
        shard = out / f"pictures-{position:06d}.tar"
        if not shard.exists():
            _write_shard(shard, pictures[start : start + per_shard], report)
        shards.append(shard)
    return shards


def _write_shard(shard: Path, pictures: Sequence[PictureFiles], report: Callable[[], None]) -> None:
    with atomic_write(shard) as part, tarfile.open(part, "w", format=tarfile.PAX_FORMAT, encoding="utf-8") as tar:
        for picture in pictures:
            for name, content in _members(picture):
                entry = tarfile.TarInfo(name)  # user 0, time 0
                entry.size = len(content)
                tar.addfile(entry, io.BytesIO(content))
            report()


def _members(picture: PictureFiles) -> Iterator[tuple[str, bytes]]:
    """The files of a picture: name in the shard, and content."""
    suffixes = {"image": picture.image.suffix.lower(), "mask": ".mask.png", "lens": ".lens.yaml"}
    for part in PARTS:
        yield picture.number + suffixes[part], picture.read(part)


def _prepare(out: Path, pictures: Sequence[PictureFiles], per_shard: int) -> None:
    """Make the folder and its shards.json. Raises InputError if it holds shards of other pictures."""
    if any(each.image.parent.resolve() == out.resolve() for each in pictures):
        raise InputError(f"{out} is the folder of the pictures: write to another folder")
    path = out / "shards.json"
    try:
        facts = [f"{each.number} {each.size('image')} {each.size('mask')}" for each in pictures]
        digest = hashlib.sha256("\n".join(facts).encode("utf-8", "surrogateescape")).hexdigest()
        plan = {"format": _FORMAT, "pictures": len(pictures), "per_shard": per_shard, "files_sha256": digest}
        out.mkdir(parents=True, exist_ok=True)
        if path.exists():
            if json.loads(read_regular(path)) != plan:
                raise InputError(f"{out} holds shards of other pictures, or of another --size: write to another folder")
        elif any(out.glob("*.tar")):
            raise InputError(f"{out} holds other tar files: write to another folder")
    except OSError as error:
        raise InputError(f"can't use folder {out}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is damaged: write to another folder") from error
    write_file(path, json.dumps(plan, indent=1) + "\n")
