"""The structure of a COCO file: lists of images, annotations and categories, as tables."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeGuard

from vm_embedded.errors import InputError, one_line
from vm_workstation.class_names import class_name

from .folder_files import FolderFiles, read_bytes, read_text

Entry = Mapping[str, Any]

Id = int | str
"""COCO has numbers; some programs write texts."""

_TELLING = (b'"file_name"', b'"image_id"')


@dataclass(frozen=True)
class CocoFile:
    """A COCO file. categories: names by id."""

    images: Sequence[Entry]
    annotations: Sequence[Entry]
    categories: Mapping[Id, str]


def coco_files(files: FolderFiles) -> list[Path]:
    """The JSON files of a folder that look like COCO, whether or not they are cut short."""
    return [path for path in files.with_suffix(".json") if _is_telling(path)]


def _is_telling(path: Path) -> bool:
    try:
        content = read_bytes(path)
    except InputError:
        return True  # so that its reader reports it
    return any(word in content for word in _TELLING)


def parse_coco(path: Path) -> CocoFile:
    """A COCO file. Raises InputError without its name if it is cut short, or lacks one of its lists."""
    try:
        table = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"is cut short or not JSON ({one_line(error)})") from error
    lists = []
    for name in ("images", "annotations", "categories"):
        entries = table.get(name) if isinstance(table, dict) else None
        if not isinstance(entries, list) or not all(isinstance(each, dict) for each in entries):
            raise InputError(f"lacks {name}, a list of tables")
        lists.append(entries)
    images, annotations, categories = lists
    return CocoFile(images, annotations, _names(categories))


def _names(categories: Sequence[Entry]) -> dict[Id, str]:
    names: dict[Id, str] = {}
    for entry in categories:
        key, name = entry.get("id"), entry.get("name")
        if not is_id(key) or not isinstance(name, str) or not name.strip():
            raise InputError(f"category {shown(dict(entry))} needs an id and a name")
        name = class_name(name)
        if names.setdefault(key, name) != name:
            raise InputError(f"category {shown(key)} has two names, {names[key]!r} and {name!r}")
    return names


def is_id(value: object) -> TypeGuard[Id]:
    """Whether a value can be an id: a whole number or a text."""
    return isinstance(value, int | str) and not isinstance(value, bool)


def number(value: object) -> float:
    """A value of JSON as a number. Raises InputError for any other value."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{shown(value)} is not a number")
    try:
        return float(value)
    except OverflowError as error:
        raise InputError(f"{shown(value)} is too large") from error


def shown(value: object) -> str:
    """A value of JSON for messages, in at most 60 characters."""
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
