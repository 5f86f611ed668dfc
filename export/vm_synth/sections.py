"""Configurations: TOML files of sections, each a dataclass of the entries of ranges.py.

A section of another kind says in its field's metadata how it is `read` from its table, and has a method `documented`.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import Field, fields
from pathlib import Path
from typing import Any, TypeVar

from vm_embedded.errors import InputError, VisualMeshError, unknown

Configuration = TypeVar("Configuration")


def read_sections(
    kind: type[Configuration], path: Path | None, overrides: Mapping[str, Mapping[str, Any]] | None = None
) -> Configuration:
    """Read a configuration, a dataclass of sections, from a TOML file, or take all defaults.

    overrides: entries by section that count instead of the file's. Raises InputError naming file, section, entry and
    what is allowed.
    """
    table = _table(path) if path else {}
    for name, entries in (overrides or {}).items():
        table[name] = {**table.get(name, {}), **entries}
    try:
        read: Configuration = _configuration(kind, table)
        return read
    except VisualMeshError as error:
        raise InputError(f"configuration {path}: {error}" if path else f"configuration: {error}") from error


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


def _table(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"can't read configuration {path}: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"configuration {path}: {error}") from error


def _configuration(kind: Any, table: Mapping[str, Any]) -> Any:
    known_sections = {each.name: each for each in fields(kind)}
    sections = {}
    for name, entries in table.items():
        if name not in known_sections:
            raise InputError(unknown("section", name, known_sections))
        if not isinstance(entries, Mapping):
            raise InputError(f"{name} must be a section, [{name}], not {entries!r}")
        section: Any = known_sections[name]
        read = section.metadata.get("read")
        if read is None:
            known = [each.name for each in fields(section.default_factory)]
            for key in entries:
                if key not in known:
                    raise InputError(unknown(f"entry in [{name}]", key, known))
        try:
            sections[name] = read(entries) if read else section.default_factory(**entries)
        except InputError as error:
            raise InputError(f"[{name}] {error}") from error
    return kind(**sections)


def documented(configuration: Any) -> Iterator[str]:
    """Lines of a TOML file with every entry, its meaning, unit and limits."""
    for section in fields(configuration):
        values = getattr(configuration, section.name)
        yield f"[{section.name}]"
        if "read" in section.metadata:
            yield from values.documented()
        else:
            for entry in fields(values):
                yield from _entry(entry, getattr(values, entry.name))
        yield ""


def _entry(entry: Field[Any], value: Any) -> Iterator[str]:
    unit = f" [{entry.metadata['unit']}]" if entry.metadata.get("unit") else ""
    yield f"# {entry.metadata['help']}{unit}{_limits(entry)}"
    yield f"{entry.name} = {_toml(value)}"


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
