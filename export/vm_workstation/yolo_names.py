"""The names of the classes of label files in YOLO format, from classes.txt, obj.names, _darknet.labels or data.yaml."""

from __future__ import annotations

import re
from pathlib import Path

from vm_embedded.config.yaml_reader import read_yaml
from vm_embedded.errors import InputError
from vm_embedded.files import exists, read_text

from .class_names import class_name

_TABLES = ("classes.txt", "obj.names", "_darknet.labels", "data.yaml", "data.yml", "dataset.yaml", "dataset.yml")

_KEY = re.compile(r"names[ \t]*:")
_NO_BRACKET = re.compile(r"""(?<![^ \[{,:])("[^"]*"|'[^']*')|(?<!\S)#.*""")
"""Quoted texts and comments, whose brackets do not count."""


class NameTables:
    """The tables of names for the label files of a folder `top`."""

    def __init__(self, top: Path) -> None:
        self._above = set(top.absolute().parents)
        self._names: dict[Path, tuple[str, ...]] = {}

    def of(self, folder: Path) -> tuple[str, ...]:
        """The names by number for the label files in a folder; empty if there is no table.

        They are in the nearest table: in this folder or in one above it, up to the one directly above `top`. Raises
        InputError for an unusable table, and for tables in one folder that differ.
        """
        folder = folder.absolute()
        if folder not in self._names:
            highest = folder in self._above or folder == folder.parent
            self._names[folder] = _read_tables(folder) or (() if highest else self.of(folder.parent))
        return self._names[folder]


def tables_in(folder: Path) -> list[Path]:
    """The tables of names directly in a folder."""
    return [path for path in (folder / name for name in _TABLES) if exists(path)]


def _read_tables(folder: Path) -> tuple[str, ...]:
    tables = {path: _read(path) for path in tables_in(folder)}
    for path, names in tables.items():
        first = next(iter(tables))
        if names != tables[first]:
            raise InputError(f"{first} and {path} name the classes differently: remove one of them")
    return next(iter(tables.values()), ())


def _read(path: Path) -> tuple[str, ...]:
    text = read_text(path)
    try:
        # Not splitlines: for other programs, no other character ends a line.
        lines = text.rstrip().split("\n") if path.suffix in (".txt", ".names", ".labels") else _yaml_names(text)
        if not lines or not all(line.strip() for line in lines):
            raise InputError("must give a name for each class number")
        names = tuple(map(class_name, lines))
        if len(set(names)) < len(names):
            raise InputError(f"has a name twice: {', '.join(names)}")
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return names


def _yaml_names(text: str) -> list[str]:
    """The entry `names` of a YAML text: a list, or a mapping from the numbers 0, 1, ... Raises InputError."""
    entry = read_yaml(_entry(text)) or {"names": None}
    if not isinstance(entry, dict):
        raise InputError("names lacks a space after its colon")
    names = entry["names"]
    if isinstance(names, dict):
        if set(names) != set(map(str, range(len(names)))):
            raise InputError(f"names must have the numbers from 0 to {len(names) - 1}")
        names = [names[str(number)] for number in range(len(names))]
    if not isinstance(names, list):
        raise InputError("lacks names, the list of class names")
    return ["" if name is None else str(name) for name in names]


def _entry(text: str) -> str:
    """The lines of the entry `names`; the others may be YAML that read_yaml rejects, such as a download script.

    Lines belong to it if they are indented, and between brackets in any case.
    """
    entry: list[str] = []
    depth = 0
    for line in text.split("\n"):
        if not entry and not _KEY.match(line):
            continue
        if entry and not depth and line[:1] not in ("", *" \t-]}#"):
            break
        entry.append(line)
        plain = _NO_BRACKET.sub("", line)
        depth += sum(map(plain.count, "[{")) - sum(map(plain.count, "]}"))
    return "\n".join(entry)
