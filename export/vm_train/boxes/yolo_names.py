"""Tables of class names beside YOLO text files: classes.txt, obj.names, data.yaml."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vm_embedded.errors import InputError, one_line

from .folder_files import FolderFiles, read_text

_LISTS = ("classes.txt", "obj.names")
_TABLES = ("data.yaml", "data.yml", "dataset.yaml", "dataset.yml")


def is_name_table(path: Path) -> bool:
    """Whether a file is a table of class names, by its name."""
    return path.name.lower() in (*_LISTS, *_TABLES) or path.suffix.lower() == ".names"


def read_names(files: FolderFiles) -> tuple[str, ...] | None:
    """The class names by number, from a table in the folder or directly above it; None if there is none.

    Raises InputError for an unreadable table, and for tables that differ.
    """
    paths = [path for path in files.others if is_name_table(path)]
    if not paths:
        above = files.folder.absolute().parent
        paths = [above / name for name in (*_LISTS, *_TABLES) if (above / name).is_file()]
    tables = [(path, _read(path)) for path in paths]
    if not tables:
        return None
    first, names = tables[0]
    for path, others in tables[1:]:
        if others != names:
            raise InputError(f"{first} and {path} name the classes differently: remove one of them")
    return names


def _read(path: Path) -> tuple[str, ...]:
    import yaml  # only training has it

    try:
        text = read_text(path)
        if path.suffix.lower() in (".yaml", ".yml"):
            names = [" ".join(name.split()) for name in _names_in(yaml.safe_load(text))]
        else:
            names = [line.strip() for line in text.rstrip().splitlines()]
    except (InputError, yaml.YAMLError) as error:
        raise InputError(f"{path}: {one_line(error)}") from error
    if not names or not all(names):
        raise InputError(f"{path}: must give a name for each class number")
    return tuple(names)


def _names_in(table: Any) -> list[str]:
    """The entry `names`, a list or a mapping from the numbers 0, 1, ... Raises InputError."""
    names = table.get("names") if isinstance(table, dict) else None
    if isinstance(names, dict):
        if set(names) != set(range(len(names))):
            raise InputError(f"names must have the numbers from 0 to {len(names) - 1}")
        names = [names[number] for number in range(len(names))]
    if not isinstance(names, list):
        raise InputError("lacks names, the list of class names")
    return [str(name) for name in names]
