"""Configurations: TOML files of sections, each a dataclass of the entries of entries.py.

What is no such section says in its field's metadata how it is `read` from its value and `documented` again.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import Field, fields
from pathlib import Path
from typing import Any, TypeVar

from ..errors import InputError, VisualMeshError, unknown
from .entries import EntryError

Configuration = TypeVar("Configuration")


def read_sections(
    kind: type[Configuration], path: Path | None, overrides: Mapping[str, Mapping[str, Any]] | None = None
) -> Configuration:
    """Read a configuration, a dataclass of sections, from a TOML file, or take all defaults.

    overrides: entries by section that count instead of the file's. Raises InputError naming file, section, entry and
    what is allowed.
    """
    text = _text(path) if path else ""
    where = f"configuration {path}" if path else "configuration"
    try:
        table: dict[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: {error}") from error
    for name, entries in (overrides or {}).items():
        table[name] = {**_section(name, table.get(name, {})), **entries}
    try:
        read: Configuration = _configuration(kind, table)
        return read
    except _Fault as fault:
        line = line_of(text, fault.section, fault.entry)
        raise InputError(f"{where}{'' if line is None else f', line {line}'}: {fault}") from fault
    except VisualMeshError as error:
        raise InputError(f"{where}: {error}") from error


class _Fault(InputError):
    """What is wrong with a section, or with an entry of it."""

    def __init__(self, section: str, entry: str | None, message: str) -> None:
        super().__init__(message)
        self.section, self.entry = section, entry


_HEADER = re.compile(r"\s*\[\s*([^\[\]]+?)\s*\]\s*(#.*)?")
_ENTRY = re.compile(r"\s*(?:\"([^\"]*)\"|'([^']*)'|([A-Za-z0-9_.-]+))\s*=")


def line_of(text: str, section: str, entry: str | None) -> int | None:
    """Number of the line, from 1, where an entry of a section begins, or the section itself; None if none is seen."""
    current = ""
    for number, line in enumerate(text.splitlines(), 1):
        header, assigned = _HEADER.fullmatch(line), _ENTRY.match(line)
        if header:
            current = header[1].strip("\"'")
            if (current, None) == (section, entry):
                return number
        elif assigned:
            key = next(each for each in assigned.groups() if each is not None)
            if (current, key) == ((section, entry) if entry else ("", section)):
                return number
    return None


def overrides_of(given: Sequence[str], example: str) -> dict[str, dict[str, Any]]:
    """Sections of entries from SECTION.ENTRY=VALUE; a value is as in TOML, or a plain word. Raises InputError."""
    sections: dict[str, dict[str, Any]] = {}
    for each in given:
        path, equals, text = each.partition("=")
        section, dot, entry = path.strip().partition(".")
        if not (equals and dot and entry):
            raise InputError(f"--set {each!r} is not like {example}")
        try:
            value = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            value = text.strip()
        sections.setdefault(section, {})[entry] = value
    return sections


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"can't read configuration {path}: {error.strerror or error}") from error
    except ValueError as error:  # not text, or a path with a zero byte
        raise InputError(f"configuration {path}: {error}") from error


def _section(name: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(f"{name} must be a section, [{name}], not {value!r}")
    return value


def _configuration(kind: Any, table: Mapping[str, Any]) -> Any:
    known = {each.name: each for each in fields(kind)}
    sections = {}
    for name, value in table.items():
        if name not in known:
            raise _Fault(name, None, unknown("section" if isinstance(value, Mapping) else "key", name, known))
        try:
            sections[name] = _read(name, known[name], value)
        except _Fault:
            raise
        except EntryError as error:
            raise _Fault(name, error.entry, f"[{name}] {error}") from error
        except InputError as error:
            raise _Fault(name, None, f"[{name}] {error}" if isinstance(value, Mapping) else str(error)) from error
    return kind(**sections)


def _read(name: str, section: Field[Any], value: Any) -> Any:
    if "read" in section.metadata:
        return section.metadata["read"](value)
    kind: Any = section.default_factory
    known = [each.name for each in fields(kind)]
    for key in _section(name, value):
        if key not in known:
            raise _Fault(name, key, unknown(f"entry in [{name}]", key, known))
    return kind(**value)


def documented(configuration: Any) -> Iterator[str]:
    """Lines of a TOML file with every entry, its meaning, unit and limits."""
    for section in fields(configuration):
        values = getattr(configuration, section.name)
        if "read" in section.metadata:
            yield from section.metadata["documented"](values)
        else:
            yield f"[{section.name}]"
            for entry in fields(values):
                yield from _entry(entry, getattr(values, entry.name))
        yield ""


def _entry(entry: Field[Any], value: Any) -> Iterator[str]:
    unit = f" [{entry.metadata['unit']}]" if entry.metadata.get("unit") else ""
    yield f"# {entry.metadata['help']}{unit}{_limits(entry)}"
    yield f"# {entry.name} =" if value is None else f"{entry.name} = {_toml(value)}"


def _limits(entry: Field[Any]) -> str:
    if "allowed" in entry.metadata:
        return f"; of {', '.join(entry.metadata['allowed'])}"
    low, high = entry.metadata.get("limits", (None, None))
    if low is None:
        return ""
    return f"; {low:g} to {high:g}" if high != float("inf") else f"; at least {low:g}"


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        pairs = ", ".join(f"{_toml(name)} = {_toml(each)}" for name, each in value.items())
        return f"{{ {pairs} }}" if pairs else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(each) for each in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return short if float(short := f"{value:g}") == value else repr(value)
