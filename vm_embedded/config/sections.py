"""Reading configurations: TOML files of sections, each a dataclass of entries as in entries.py.

A top-level value that is not such a section has two functions in its field's metadata: `read` makes the value from
TOML, and `to_commented_toml` turns it back into text (see toml_writer.py).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import Field, fields
from pathlib import Path
from typing import Any, TypeVar

from ..errors import InputError, VisualMeshError, unknown
from ..files import read_text
from .entries import EntryError
from .toml_reader import parse_toml

Configuration = TypeVar("Configuration")


def read_sections(
    kind: type[Configuration],
    path: Path | None,
    overrides: Mapping[str, Mapping[str, Any]] | None = None,
    defaults: Mapping[str, Mapping[str, Any]] | None = None,
) -> Configuration:
    """Read a configuration, a dataclass of sections, from a TOML file; without a file, use all defaults.

    overrides: entries by section that replace those of the file. defaults: entries by section that replace
    the defaults; a section with a `read` of its own is taken whole. Raises InputError naming the file, line, section
    and entry, and the allowed values.
    """
    text = read_text(path, "configuration") if path else ""
    where = f"configuration {path}" if path else "configuration"
    try:
        table = parse_toml(text)
    except InputError as error:
        is_yaml = path is not None and path.suffix.lower() in (".yaml", ".yml")
        raise InputError(f"{where}: {'it must be TOML, not YAML: ' if is_yaml else ''}{error}") from error
    for name, entries in (overrides or {}).items():
        table[name] = {**_checked_section(name, table.get(name, {})), **entries}
    _fill_in(kind, table, defaults or {})
    try:
        read: Configuration = _build(kind, table)
        return read
    except _Fault as fault:
        line = _line_number(text, fault.section, fault.entry)
        raise InputError(f"{where}{'' if line is None else f', line {line}'}: {fault}") from fault
    except VisualMeshError as error:
        raise InputError(f"{where}: {error}") from error


def _fill_in(kind: Any, table: dict[str, Any], defaults: Mapping[str, Mapping[str, Any]]) -> None:
    """Add the entries that a table lacks. Raises InputError."""
    whole = {each.name for each in fields(kind) if "read" in each.metadata}
    for name, entries in defaults.items():
        if name in whole:
            table.setdefault(name, entries)
        else:
            table[name] = {**entries, **_checked_section(name, table.get(name, {}))}


class _Fault(InputError):
    """An error in a section, or in one entry of it."""

    def __init__(self, section: str, entry: str | None, message: str) -> None:
        super().__init__(message)
        self.section, self.entry = section, entry


_HEADER = re.compile(r"\s*\[\s*([^\[\]]+?)\s*\]\s*(#.*)?")
_ENTRY = re.compile(r"\s*(?:\"([^\"]*)\"|'([^']*)'|([A-Za-z0-9_.-]+))\s*=")


def _line_number(text: str, section: str, entry: str | None) -> int | None:
    """Number, from 1, of the line where an entry of a section begins; None if not found.

    Without an entry: the line of the section's header, or of a top-level value with that name.
    """
    wanted = (section, entry) if entry else ("", section)
    current = ""
    for number, line in enumerate(text.split("\n"), 1):
        header, assigned = _HEADER.fullmatch(line), _ENTRY.match(line)
        if header:
            current = header[1].strip("\"'")
            if not entry and current == section:
                return number
        elif assigned:
            key = next(each for each in assigned.groups() if each is not None)
            if (current, key) == wanted:
                return number
    return None


def parse_overrides(given: Sequence[str], example: str) -> dict[str, dict[str, Any]]:
    """Entries by section from texts SECTION.ENTRY=VALUE.

    A value that is not valid TOML is taken as a string. example: shown in the message. Raises InputError.
    """
    sections: dict[str, dict[str, Any]] = {}
    for each in given:
        path, equals, text = each.partition("=")
        section, dot, entry = path.strip().partition(".")
        if not (equals and dot and entry):
            raise InputError(f"--set {each!r} must have the form SECTION.ENTRY=VALUE, as in {example}")
        try:
            value = parse_toml(f"value = {text}")["value"]
        except InputError:
            value = text.strip()
        sections.setdefault(section, {})[entry] = value
    return sections


def _checked_section(name: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(f"{name} must be a section, [{name}], not {value!r}")
    return value


def _build(kind: Any, table: Mapping[str, Any]) -> Any:
    """A configuration from the tables of a file. Raises _Fault."""
    known = {each.name: each for each in fields(kind)}
    sections = {}
    for name, value in table.items():
        if name not in known:
            raise _Fault(name, None, _unknown_name(name, value, known))
        try:
            sections[name] = _read_value(name, known[name], value)
        except _Fault:
            raise
        except EntryError as error:
            raise _Fault(name, error.entry, f"[{name}] {error}") from error
        except InputError as error:
            raise _Fault(name, None, f"[{name}] {error}" if isinstance(value, Mapping) else str(error)) from error
    return kind(**sections)


def _unknown_name(name: str, value: Any, known: Mapping[str, Field[Any]]) -> str:
    """Message for an unknown name above all sections: an entry of a section, or a mistyped section or key."""
    owners = [f"[{each}]" for each, section in known.items() if name in _entries(section)]
    if owners:
        return f"unknown key {name!r}: it belongs in {' or '.join(owners)}"
    return unknown("section" if isinstance(value, Mapping) else "key", name, known)


def _entries(section: Field[Any]) -> list[str]:
    """Names of the entries of a section; none of a top-level value with its own `read`."""
    kind: Any = section.default_factory
    return [] if "read" in section.metadata else [each.name for each in fields(kind)]


def _read_value(name: str, section: Field[Any], value: Any) -> Any:
    """A top-level value: by its own `read`, or as a section. Raises InputError."""
    if "read" in section.metadata:
        return section.metadata["read"](value)
    kind: Any = section.default_factory
    known = _entries(section)
    for key in _checked_section(name, value):
        if key not in known:
            raise _Fault(name, key, unknown(f"entry in [{name}]", key, known))
    return kind(**value)
