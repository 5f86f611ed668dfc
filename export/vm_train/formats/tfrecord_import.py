"""Import of the reference implementation's training data: TFRecord files become a folder of pictures.

Each record gives image0000012.jpg or .png and mask0000012.png, with the bytes that the record holds, and
lens0000012.yaml. The number counts the records of all files from 0, so a skipped record leaves a gap, and an import
that was stopped can continue. The image is written last and marks the picture as complete. import.json names the files
and options; with it, an import never continues in a folder of other pictures.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vm_embedded.errors import InputError, VisualMeshError, unknown
from vm_embedded.files import read_regular, write_file

from ..data.picture_files import IMAGES, PARTS
from .picture_example import KEYS, SUFFIXES, ExamplePicture, WrongUnitError, picture_of
from .tfrecord import Record, read_records

FORMAT = 1
"""Version of import.json."""


@dataclass(frozen=True)
class Imported:
    """The result of an import.

    count: pictures written. skipped: a line for each record without a usable picture: file, record and fault.
    there: pictures that an earlier run wrote.
    """

    count: int
    skipped: tuple[str, ...]
    there: int


def import_records(
    files: Sequence[Path],
    out: Path,
    renaming: Mapping[str, str],
    normalized: bool,
    strict: bool,
    report: Callable[[float], None],
) -> Imported:
    """Write the pictures of TFRecord files to a folder, except those that are there already.

    renaming: the files' names of features, by our names in KEYS. normalized: the files give focal length, center and k
    for an image of width 1, not in pixels. report: is called after each record with the share of all bytes read, 0 to
    1. A record that lacks a feature or can't be decoded is skipped; with `strict` it raises InputError. Always raises
    InputError for an unknown key, an unreadable file, lenses in the other unit, and a folder that holds something else.
    """
    for key in renaming:
        if key not in KEYS:
            raise InputError(unknown("key", key, KEYS))
    plan = _plan(files, renaming, normalized)
    wanted = _prepared(out, plan)
    sizes = [each["bytes"] for each in plan["files"]]
    number = count = there = 0
    skipped: list[str] = []
    for position, path in enumerate(files):
        before = sum(sizes[:position])
        for record in read_records(path):
            if _is_done(out, number):
                there += 1
            elif isinstance(found := _picture_or_fault(record, renaming, normalized, strict), str):
                skipped.append(found)
            else:
                _import_picture(found, number, out, None if count else wanted)
                count += 1
            number += 1
            report((before + record.position) / sum(sizes))
    return Imported(count, tuple(skipped), there)


def _picture_or_fault(
    record: Record, renaming: Mapping[str, str], normalized: bool, strict: bool
) -> ExamplePicture | str:
    """The picture in a record, or the reason to skip it. Raises that as an error if strict or for a wrong unit."""
    try:
        return _picture(record, renaming, normalized)
    except VisualMeshError as error:
        if strict or isinstance(error, WrongUnitError):
            raise
        return str(error)


def _import_picture(picture: ExamplePicture, number: int, out: Path, wanted: str | None) -> None:
    """Write the files of a picture; before, `wanted` as import.json, if it is not None."""
    if wanted is not None:
        write_file(out / "import.json", wanted)
    for name, data in picture.files(number).items():
        write_file(out / name, data)


def _picture(record: Record, renaming: Mapping[str, str], normalized: bool) -> ExamplePicture:
    """The picture in a record. Raises InputError naming file and record; WrongUnitError stays one."""
    example = record.example()
    try:
        return picture_of(example, renaming, normalized)
    except VisualMeshError as error:
        kind = WrongUnitError if isinstance(error, WrongUnitError) else InputError
        raise kind(f"{record.where}: {error}") from error


def _plan(files: Sequence[Path], renaming: Mapping[str, str], normalized: bool) -> dict[str, Any]:
    """The content of import.json. It knows files by name and size, so they may be moved."""
    try:
        named = [{"name": path.name, "bytes": path.stat().st_size} for path in files]
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        name = getattr(error, "filename", None) or files
        raise InputError(f"can't read {name}: {getattr(error, 'strerror', None) or error}") from error
    return {"format": FORMAT, "files": named, "renaming": dict(renaming), "normalized": normalized}


def _prepared(out: Path, plan: dict[str, Any]) -> str | None:
    """Make the folder. Returns the text to write to import.json before the first picture, None if it needs no change.

    A later import may append files, or leave out files at the end. Raises InputError if the folder holds something
    else.
    """
    path = out / "import.json"
    try:
        out.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            others = [each.name for each in out.iterdir() if _is_of_picture(each)]
            if others:
                raise InputError(f"{out} holds {min(others)}, which no import wrote: write to another folder")
            return _text(plan)
        found = json.loads(read_regular(path))
        same = all(found[key] == plan[key] for key in ("format", "renaming", "normalized"))
        same &= all(old == new for old, new in zip(found["files"], plan["files"], strict=False))
        longer = len(plan["files"]) > len(found["files"])
    except OSError as error:
        raise InputError(f"can't use folder {out}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{path} is damaged: write to another folder") from error
    if not same:
        raise InputError(
            f"{out} holds an import of other files, or with other options: use the files and options in its "
            "import.json, or write to another folder"
        )
    return _text(plan) if longer else None


def _is_of_picture(path: Path) -> bool:
    return path.name.startswith(PARTS) and path.suffix.lower() in (*IMAGES, ".yaml")


def _text(plan: dict[str, Any]) -> str:
    return json.dumps(plan, indent=1) + "\n"


def _is_done(out: Path, number: int) -> bool:
    images = (out / f"image{number:07d}{suffix}" for suffix in SUFFIXES.values())
    others = (out / f"mask{number:07d}.png", out / f"lens{number:07d}.yaml")
    return any(each.is_file() for each in images) and all(each.is_file() for each in others)
