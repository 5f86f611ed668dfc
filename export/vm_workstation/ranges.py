"""Configuration entries that values are drawn from: ranges of numbers and lists of names."""

from __future__ import annotations

from dataclasses import Field
from typing import Any

import numpy as np

from vm_embedded.config.entries import checked_number, entry
from vm_embedded.errors import InputError, unknown

Range = tuple[float, float]
"""Lowest and highest value to draw."""


def range_of(low: float, high: float, help: str, unit: str = "", limits: Range = (0.0, np.inf)) -> Any:
    """An entry that is a Range with this default; both ends must be within the limits."""
    return entry(_checked_range, (low, high), help, unit, limits=limits)


def some_of(allowed: tuple[str, ...], help: str, default: tuple[str, ...] | None = None) -> Any:
    """An entry that lists some of the allowed names; all of them by default."""
    return entry(_checked_names, allowed if default is None else default, help, allowed=allowed)


def _checked_range(entry: Field[Any], value: Any) -> Range:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise InputError(f"{entry.name} must be a range [low, high], not {value!r}")
    low, high = (checked_number(entry, each) for each in value)
    if low > high:
        raise InputError(f"{entry.name} must be [low, high]; {low:g} is above {high:g}")
    return (low, high)


def _checked_names(entry: Field[Any], value: Any) -> tuple[str, ...]:
    allowed = entry.metadata["allowed"]
    if not isinstance(value, list | tuple) or not value:
        raise InputError(f"{entry.name} must be a list of some of {', '.join(allowed)}, not {value!r}")
    for each in value:
        if each not in allowed:
            raise InputError(unknown(entry.name, each, allowed))
    return tuple(value)


def drawn(random: np.random.Generator, share: float) -> bool:
    """Whether something happens that happens with this share. For a share of 0 no number is drawn, so all that follows
    is the same as without the question."""
    return share > 0.0 and random.random() < share


def uniform(random: np.random.Generator, span: Range) -> float:
    """A number from a uniform distribution over the range."""
    return float(random.uniform(*span))


def log_uniform(random: np.random.Generator, span: Range) -> float:
    """A number whose logarithm has a uniform distribution over a range above 0."""
    return float(np.exp(random.uniform(np.log(span[0]), np.log(span[1]))))
