"""vm-train shards: pictures as tar files, as webdataset has them, for sets that outgrow a disk or come over a network.

A shard holds NUMBER.jpg or .png, NUMBER.mask.png and NUMBER.lens.yaml of each picture, byte for byte as they were. The
same pictures give the same bytes. shards.json names the pictures, so that a run that was stopped goes on, and other
pictures are not mixed in.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import json
import sys
import tarfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError
from vm_embedded.files import written_beside
from vm_workstation.option_types import at_least

from ..data.picture_files import PARTS, PictureFiles
from ..data.pictures import find_pictures
from ..data.shard_index import open_shards as open_shards
from ..data.shard_stream import stream as stream

EXIT_OK = 0

_FORMAT = 1
"""Of shards.json."""


def shards_parser() -> argparse.ArgumentParser:
    """The options of vm-train shards DATA OUT."""
    made = argparse.ArgumentParser(
        prog="vm-train shards",
        description="Write a folder of pictures as tar files that vm-train reads as they are, and that can stream, "
        "in webdataset's form. A run that was stopped goes on with the same command.",
    )
    made.add_argument("data", type=Path, metavar="DATA", help="folder of imageX.jpg or .png, maskX.png, lensX.yaml")
    made.add_argument("out", type=Path, metavar="OUT", help="folder to write to; made if it is not there")
    made.add_argument("--size", type=at_least(1), default=1000, metavar="N", help="pictures in each; default 1000")
    return made


def run_shards(options: argparse.Namespace) -> int:
    """Write shards as the options say and return the exit status. Raises InputError as write_shards does."""
    pictures = find_pictures(options.data)
    bar = ProgressBar(len(pictures), "vm-train")
    try:
        shards = write_shards(pictures, options.out, options.size, bar.advance)
    finally:
        bar.clear()
    there = len(pictures) - bar.done
    if there:
        print(f"vm-train: {there} pictures were there already", file=sys.stderr)
    print(f"{options.out}: {len(pictures)} pictures in {len(shards)} shards")
    return EXIT_OK


def write_shards(pictures: Sequence[PictureFiles], out: Path, per_shard: int, report: Callable[[], None]) -> list[Path]:
    """Write pictures as out/pictures-000000.tar and so on, those that are not there yet; report each that is written.

    Raises InputError for a file that can't be read or written, a number that can't be a name in a shard, and a folder
    that holds shards of other pictures.
    """
    for picture in pictures:
        if "." in picture.number or not picture.number:
            raise InputError(f"picture {picture.number!r} can't be in a shard: its number must have no dot there")
    _prepare(out, pictures, per_shard)
    shards = []
    for position, start in enumerate(range(0, len(pictures), per_shard)):
        shard = out / f"pictures-{position:06d}.tar"
        if not shard.exists():
            with (
                written_beside(shard) as part,
                tarfile.open(part, "w", format=tarfile.PAX_FORMAT, encoding="utf-8") as tar,
            ):
                for picture in pictures[start : start + per_shard]:
                    for name, content in _members(picture):
                        entry = tarfile.TarInfo(name)  # of user 0 at time 0
                        entry.size = len(content)
                        tar.addfile(entry, io.BytesIO(content))
                    report()
        shards.append(shard)
    return shards


def _members(picture: PictureFiles) -> Iterator[tuple[str, bytes]]:
    """Names in a shard, and contents, of a picture's files."""
    suffixes = {"image": picture.image.suffix.lower(), "mask": ".mask.png", "lens": ".lens.yaml"}
    for part in PARTS:
        yield picture.number + suffixes[part], picture.read(part)


def _prepare(out: Path, pictures: Sequence[PictureFiles], per_shard: int) -> None:
    """Make the folder and its shards.json. Raises InputError if it holds shards of other pictures."""
    digest = hashlib.sha256("\n".join(each.number for each in pictures).encode("utf-8", "surrogateescape")).hexdigest()
    plan = {"format": _FORMAT, "pictures": len(pictures), "per_shard": per_shard, "numbers_sha256": digest}
    path = out / "shards.json"
    try:
        out.mkdir(parents=True, exist_ok=True)
        if path.exists():
            if json.loads(path.read_text(encoding="utf-8")) != plan:
                raise InputError(f"{out} holds shards of other pictures, or of another size: write to another folder")
        elif any(out.glob("*.tar")):
            raise InputError(f"{out} holds tar files of something else: write to another folder")
    except OSError as error:
        raise InputError(f"can't use folder {out}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is damaged: write to another folder") from error
    with written_beside(path) as part:
        part.write_text(json.dumps(plan, indent=1) + "\n", encoding="utf-8")
