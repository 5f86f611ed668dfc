"""Setting entries of one section in an existing TOML file, line by line: all other lines and comments stay."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files import check_writable, exists, read_regular, write_file
from .toml_reader import parse_toml


def check_editable(path: Path, section: str, names: Sequence[str]) -> None:
    """Raise InputError if `write_entries` could not set these entries."""
    check_writable(path)
    _edited_file(path, section, dict.fromkeys(names, 1))


def write_entries(path: Path, section: str, entries: Mapping[str, Any]) -> None:
    """Set numbers or booleans in a section of a TOML file; create the section or the file if needed.

    Raises InputError if the file can't be read or written, or if the section can't be edited line by line.
    """
    write_file(path, _edited_file(path, section, entries))


def _edited_file(path: Path, section: str, entries: Mapping[str, Any]) -> str:
    """The new text of a file, checked to have the new entries and to keep all others."""
    try:
        text = read_regular(path).decode("utf-8-sig") if exists(path) else ""
        before = parse_toml(text)
    except UnicodeDecodeError as error:
        raise InputError(f"configuration {path} is not a text file") from error
    except (OSError, InputError) as error:
        raise InputError(f"can't read configuration {path}: {getattr(error, 'strerror', None) or error}") from error
    edited = edit_section(text, section, entries)
    try:
        after = parse_toml(edited)
    except InputError:
        after = {}
    table = before.get(section, {})
    if not isinstance(table, dict) or after != {**before, section: {**table, **entries}}:
        raise InputError(f"configuration {path} can't be edited: write its entries as lines below [{section}]")
    return edited


def edit_section(text: str, section: str, entries: Mapping[str, Any]) -> str:
    """TOML text with entries of a section set. Existing lines keep their comments; new lines follow the header."""
    values = {name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in entries.items()}
    line_end = "\r\n" if "\r\n" in text else "\n"
    lines = text.removesuffix(line_end).split(line_end) if text else []
    header = re.compile(rf"\s*\[\s*{re.escape(section)}\s*\]\s*(#.*)?")
    start = next((number for number, line in enumerate(lines) if header.fullmatch(line)), None)
    if start is None:
        lines += [*([""] if lines else []), f"[{section}]"]
        start = len(lines) - 1
    end = next((n for n in range(start + 1, len(lines)) if lines[n].lstrip().startswith("[")), len(lines))
    missing = dict(values)
    for number in range(start + 1, end):
        name, equals, rest = lines[number].partition("=")
        if equals and name.strip() in missing:
            comment = re.search(r"\s*#.*", rest)
            lines[number] = f"{name.strip()} = {missing.pop(name.strip())}{comment.group() if comment else ''}"
    lines[start + 1 : start + 1] = [f"{name} = {value}" for name, value in missing.items()]
    return line_end.join(lines) + line_end
