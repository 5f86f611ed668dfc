"""Entries of configurations: numbers, shares, names and switches, each with help, unit and limits in its metadata.

A section of a configuration is a frozen dataclass of such entries; it checks itself with `check_entries`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import Field, field, fields
from typing import Any

from ..errors import InputError, unknown

Limits = tuple[float, float]
Check = Callable[[Field[Any], Any], Any]


class EntryError(InputError):
    """A value that its entry can't have. entry: its name."""

    def __init__(self, entry: str, message: str) -> None:
        super().__init__(message)
        self.entry = entry


def entry(check: Check, default: Any, help: str, unit: str = "", **metadata: Any) -> Any:
    """An entry of any kind. `check` takes its field and a value, and gives the value as it is kept, or raises
    InputError."""
    return field(default=default, metadata={"check": check, "help": help, "unit": unit, **metadata})


def number(default: float | None, help: str, unit: str = "", limits: Limits = (0.0, math.inf)) -> Any:
    """An entry that is one number; a whole one if its default is. It may be left out if its default is None."""
    return entry(checked_number, default, help, unit, limits=limits)


def share(default: float, help: str) -> Any:
    """An entry that is a share, from 0 to 1."""
    return number(default, help, "", (0.0, 1.0))


def one_of(allowed: tuple[str, ...], default: str, help: str) -> Any:
    """An entry that is one name."""
    return entry(_name, default, help, allowed=allowed)


def switch(default: bool, help: str) -> Any:
    """An entry that is true or false."""
    return entry(_switch, default, help)


def words(default: str, help: str) -> Any:
    """An entry that is a text of one line."""
    return entry(_words, default, help)


def check_entries(section: Any) -> None:
    """Check each entry of a section and keep it as its kind does. Raises EntryError naming entry and value."""
    for each in fields(section):
        if "check" in each.metadata:
            object.__setattr__(section, each.name, checked(each, getattr(section, each.name)))


def checked(entry: Field[Any], value: Any) -> Any:
    """A value as its entry keeps it. Raises EntryError."""
    if value is None and entry.default is None:
        return None
    try:
        return entry.metadata["check"](entry, value)
    except InputError as error:
        raise EntryError(entry.name, str(error)) from error


def checked_number(entry: Field[Any], value: Any) -> float:
    """A number within the entry's limits. Raises InputError."""
    low, high = entry.metadata["limits"]
    whole = isinstance(entry.default, int) and not isinstance(entry.default, bool)
    fits = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
    if not fits or not low <= value <= min(high, sys.float_info.max):
        unit = f" {entry.metadata['unit']}" if entry.metadata["unit"] else ""
        span = f"from {low:g} to {high:g}{unit}" if math.isfinite(high) else f"of at least {low:g}{unit}"
        raise InputError(f"{entry.name} must be a {'whole ' if whole else ''}number {span}, not {value!r}")
    return int(value) if whole else float(value)


def _name(entry: Field[Any], value: Any) -> str:
    if not isinstance(value, str) or value not in entry.metadata["allowed"]:
        raise InputError(unknown(entry.name, value, entry.metadata["allowed"]))
    return value


def _switch(entry: Field[Any], value: Any) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{entry.name} must be true or false, not {value!r}")
    return value


def _words(entry: Field[Any], value: Any) -> str:
    if not isinstance(value, str) or not value.isprintable():
        raise InputError(f"{entry.name} must be a text of one line, not {value!r}")
    return value
