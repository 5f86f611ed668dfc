"""Import of pictures from tar archives, and from TFRecord files of the reference implementation, into a folder.

Archives keep the numbers of their pictures. A TFRecord file has none: each record gives image0000012.jpg or .png and
mask0000012.png, with the bytes that the record holds, and lens0000012.yaml. The number counts the records of all files
from 0, so a skipped record leaves a gap, and an import that was stopped can continue.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

from vm_embedded.errors import InputError, VisualMeshError

from ..data.picture_files import FileName
from .picture_example import WrongUnitError, picture_of
from .picture_folder import PictureFolder
from .shards import check_readable, import_shard, is_shard
from .tfexample import parse_example
from .tfrecord import read_records


@dataclass(frozen=True)
class Imported:
    """The result of an import.

    count: pictures that it wrote or completed. there: pictures that the folder had before. skipped: a line for each
    record without a usable picture, and each picture that lacks a file. remarks: further lines.
    """

    count: int
    there: int
    skipped: tuple[str, ...]
    remarks: tuple[str, ...]


def import_pictures(
    files: Sequence[str],
    out: Path,
    renaming: Mapping[str, str],
    normalized: bool,
    strict: bool,
    report: Callable[[float], None],
) -> Imported:
    """Write the pictures of archives and TFRecord files to a folder, except those that are there already.

    files: as `is_shard` tells them apart. renaming, normalized: for records, as `picture_of` takes them. report: is
    called with the share of the work that is done, 0 to 1. A record that lacks a feature or can't be decoded is
    skipped, and a picture that lacks a file is named; with `strict` they raise InputError. Always raises InputError for
    an unreadable or damaged file, lenses in the other unit, and two different pictures of one number.
    """
    for name in files:
        check_readable(name)
    convert = partial(picture_of, renaming=renaming, normalized=normalized)
    folder = PictureFolder(out)
    there, skipped, numbers = folder.count, list[str](), count()
    for position, name in enumerate(files):
        if is_shard(name):
            shares = import_shard(name, folder)
        else:
            shares = _import_records(Path(name), folder, numbers, convert, None if strict else skipped)
        for share in shares:
            report((position + share) / len(files))
    incomplete = folder.lacking(folder.imported)
    if incomplete and strict:
        raise InputError(f"{out}: {incomplete[0]}; {len(incomplete)} pictures lack a file")
    return Imported(folder.count - there, there, (*skipped, *incomplete), tuple(folder.remarks))


def _import_records(
    path: Path,
    folder: PictureFolder,
    numbers: Iterator[int],
    convert: Callable[[Any, int], dict[FileName, bytes]],
    skipped: list[str] | None,
) -> Iterator[float]:
    """Write the pictures of a TFRecord file. skipped: gets the faults of records; None: raise them."""
    for record in read_records(path):
        number = next(numbers)
        try:
            found = convert(parse_example(record.payload), number)
        except VisualMeshError as error:
            fault = f"{record.where}: {error}"
            if skipped is None or isinstance(error, WrongUnitError):
                raise InputError(fault) from error
            skipped.append(fault)
        else:
            for name, content in found.items():
                folder.write(name, content)
        yield record.share
