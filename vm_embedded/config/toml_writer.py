"""Writing a configuration as TOML text with a comment for every entry."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import Field, fields
from typing import Any

from ..borders.text import utf8
from ..errors import InputError

_BARE = re.compile("[A-Za-z0-9_-]+")


def to_commented_toml(configuration: Any, header: str = "") -> str:
    """A TOML file with every entry of a configuration, its meaning, unit and limits; `read_sections` reads it back.

    header: comment at the top, without the signs of a comment.
    """
    blocks = ["\n".join(f"# {line}" for line in header.splitlines())] if header else []
    for each in fields(configuration):
        value = getattr(configuration, each.name)
        if "read" in each.metadata:
            blocks.append(each.metadata["to_commented_toml"](value))
        else:
            entries = [_commented_entry(entry, getattr(value, entry.name)) for entry in fields(value)]
            blocks.append("\n".join([f"[{each.name}]", *entries]))
    return "\n\n".join(blocks) + "\n"


def _commented_entry(entry: Field[Any], value: Any) -> str:
    unit = f" [{entry.metadata['unit']}]" if entry.metadata.get("unit") else ""
    comment = f"# {entry.metadata['help']}{unit}{_limits(entry)}"
    return f"{comment}\n" + (f"# {entry.name} =" if value is None else f"{entry.name} = {toml_value(value)}")


def _limits(entry: Field[Any]) -> str:
    if "allowed" in entry.metadata:
        return f"; allowed: {', '.join(entry.metadata['allowed'])}"
    low, high = entry.metadata.get("limits", (None, None))
    if low is None:
        return ""
    return f"; {low:g} to {high:g}" if high != float("inf") else f"; at least {low:g}"


def toml_key(name: str) -> str:
    """The name of an entry as TOML: in quotes if it has other characters than A-Z, a-z, 0-9, _ and -."""
    return name if _BARE.fullmatch(name) else toml_value(name)


def toml_value(value: Any) -> str:
    """A text, number, boolean, list or table as TOML, in one line. Raises InputError for text that is not UTF-8."""
    if isinstance(value, Mapping):
        pairs = ", ".join(f"{toml_value(name)} = {toml_value(each)}" for name, each in value.items())
        return f"{{ {pairs} }}" if pairs else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(each) for each in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        if utf8(value) != value:
            raise InputError(f"TOML can't hold {value!r}, because it is not UTF-8: rename the file")
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return short if float(short := f"{value:g}") == value else repr(value)
