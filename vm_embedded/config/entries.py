"""Entries of a configuration: numbers, shares, names, switches and text.

A section of a configuration is a frozen dataclass. Each of its fields is an entry whose metadata holds help text, unit,
limits and a check. The section calls `check_entries` in `__post_init__`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import Field, field, fields
from typing import Any

import numpy as np

from ..errors import InputError, unknown

Limits = tuple[float, float]
Check = Callable[[Field[Any], Any], Any]


class EntryError(InputError):
    """A bad value of an entry. entry: name of the entry."""

    def __init__(self, entry: str, message: str) -> None:
        super().__init__(message)
        self.entry = entry


def entry(check: Check, default: Any, help: str, unit: str = "", **metadata: Any) -> Any:
    """An entry of any kind. `check` gets the field and a value; it returns the value to store, or raises InputError."""
    return field(default=default, metadata={"check": check, "help": help, "unit": unit, **metadata})


def number(default: float | None, help: str, unit: str = "", limits: Limits = (0.0, math.inf)) -> Any:
    """An entry that holds a number within limits: an integer if its default is one. A default of None allows None."""
    return entry(checked_number, default, help, unit, limits=limits)


def share(default: float, help: str) -> Any:
    """An entry that holds a share, from 0 to 1."""
    return number(default, help, "", (0.0, 1.0))


def one_of(allowed: tuple[str, ...], default: str, help: str) -> Any:
    """An entry that holds one of the allowed names."""
    return entry(_checked_name, default, help, allowed=allowed)


def switch(default: bool, help: str) -> Any:
    """An entry that holds true or false."""
    return entry(_checked_switch, default, help)


def text_line(default: str, help: str) -> Any:
    """An entry that holds one line of printable text."""
    return entry(_checked_text_line, default, help)


def file_name(default: str, help: str) -> Any:
    """An entry that holds a path, or an address: any name that the file system allows."""
    return entry(_checked_file_name, default, help)


def check_entries(section: Any) -> None:
    """Check each entry of a section and store it as its check returns it. Raises EntryError."""
    for each in fields(section):
        if "check" in each.metadata:
            object.__setattr__(section, each.name, checked(each, getattr(section, each.name)))


def checked(entry: Field[Any], value: Any) -> Any:
    """The value as the entry stores it. Raises EntryError with the entry's name and the value."""
    if value is None and entry.default is None:
        return None
    try:
        return entry.metadata["check"](entry, value)
    except InputError as error:
        raise EntryError(entry.name, str(error)) from error


def checked_number(entry: Field[Any], value: Any) -> float:
    """A number within the entry's limits: int if the entry's default is one, else float. Raises InputError."""
    if isinstance(value, np.ndarray | np.generic) and value.size == 1:
        value = value.item()  # OpenCV returns numbers like that
    low, high = entry.metadata["limits"]
    whole = isinstance(entry.default, int) and not isinstance(entry.default, bool)
    fits = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
    if not fits or not low <= value <= min(high, sys.float_info.max):
        unit = f" {entry.metadata['unit']}" if entry.metadata["unit"] else ""
        span = f"from {low:g} to {high:g}{unit}" if math.isfinite(high) else f"of at least {low:g}{unit}"
        raise InputError(f"{entry.name} must be a {'whole ' if whole else ''}number {span}, not {value!r}")
    return int(value) if whole else float(value)


def _checked_name(entry: Field[Any], value: Any) -> str:
    if not isinstance(value, str) or value not in entry.metadata["allowed"]:
        raise InputError(unknown(entry.name, value, entry.metadata["allowed"]))
    return value


def _checked_switch(entry: Field[Any], value: Any) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{entry.name} must be true or false, not {value!r}")
    return value


def _checked_file_name(entry: Field[Any], value: Any) -> str:
    if not isinstance(value, str) or "\0" in value:
        raise InputError(f"{entry.name} must be the name of a file, without zero bytes, not {value!r}")
    return value


def _checked_text_line(entry: Field[Any], value: Any) -> str:
    if not isinstance(value, str) or not value.isprintable():
        raise InputError(f"{entry.name} must be one line of text, not {value!r}")
    return value
