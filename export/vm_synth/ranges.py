"""Entries of the scene configuration: ranges to draw from, shares of pictures and numbers, each with unit and limits.

A section of the configuration is a frozen dataclass of such entries; it checks itself with `check_entries`.
"""

from __future__ import annotations

import sys
from dataclasses import Field, field, fields
from typing import Any

import numpy as np

from vm_embedded.errors import InputError, unknown

Range = tuple[float, float]
"""Lowest and highest value to draw."""


def drawn(low: float, high: float, help: str, unit: str = "", limits: Range = (0.0, np.inf)) -> Any:
    """An entry that is a Range; both ends stay within the limits."""
    return field(default=(low, high), metadata={"kind": "range", "help": help, "unit": unit, "limits": limits})


def share(default: float, help: str) -> Any:
    """An entry that is a share of pictures or things, from 0 to 1."""
    return field(default=default, metadata={"kind": "number", "help": help, "unit": "", "limits": (0.0, 1.0)})


def number(default: float, help: str, unit: str = "", limits: Range = (0.0, np.inf)) -> Any:
    """An entry that is one number; a whole one if its default is."""
    return field(default=default, metadata={"kind": "number", "help": help, "unit": unit, "limits": limits})


def some_of(allowed: tuple[str, ...], help: str, default: tuple[str, ...] | None = None) -> Any:
    """An entry that lists names to choose from."""
    return field(
        default=allowed if default is None else default,
        metadata={"kind": "names", "help": help, "unit": "", "allowed": allowed},
    )


def one_of(allowed: tuple[str, ...], default: str, help: str) -> Any:
    """An entry that is one name."""
    return field(default=default, metadata={"kind": "name", "help": help, "unit": "", "allowed": allowed})


def check_entries(section: Any) -> None:
    """Check each entry of a section and make ranges and names tuples. Raises InputError naming entry and value."""
    for entry in fields(section):
        if "kind" in entry.metadata:
            object.__setattr__(section, entry.name, _checked(entry, getattr(section, entry.name)))


def _checked(entry: Field[Any], value: Any) -> Any:
    kind = entry.metadata["kind"]
    if kind == "range":
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise InputError(f"{entry.name} must be a range [low, high], not {value!r}")
        low, high = (_number(entry, each) for each in value)
        if low > high:
            raise InputError(f"{entry.name} must be [low, high]; {low:g} is above {high:g}")
        return (low, high)
    if kind == "number":
        return _number(entry, value)
    allowed = entry.metadata["allowed"]
    if kind == "name":
        if value not in allowed:
            raise InputError(unknown(entry.name, value, allowed))
        return value
    if not isinstance(value, list | tuple) or not value:
        raise InputError(f"{entry.name} must be a list of some of {', '.join(allowed)}, not {value!r}")
    for each in value:
        if each not in allowed:
            raise InputError(unknown(entry.name, each, allowed))
    return tuple(value)


def _number(entry: Field[Any], value: Any) -> Any:
    low, high = entry.metadata["limits"]
    whole = isinstance(entry.default, int) and not isinstance(entry.default, bool)
    fits = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
    if not fits or not low <= value <= min(high, sys.float_info.max):
        unit = f" {entry.metadata['unit']}" if entry.metadata["unit"] else ""
        span = f"from {low:g} to {high:g}{unit}" if np.isfinite(high) else f"of at least {low:g}{unit}"
        raise InputError(f"{entry.name} must be a {'whole ' if whole else ''}number {span}, not {value!r}")
    return int(value) if whole else float(value)


def uniform(random: np.random.Generator, span: Range) -> float:
    """A number of a range, all alike."""
    return float(random.uniform(*span))


def log_uniform(random: np.random.Generator, span: Range) -> float:
    """A positive number of a range, all its factors alike."""
    return float(np.exp(random.uniform(np.log(span[0]), np.log(span[1]))))
