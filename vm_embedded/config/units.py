"""Lengths and angles as users write them: numbers, or text such as "0.6" and "20deg"."""

from __future__ import annotations

import math
import re
from dataclasses import Field
from typing import Any

from ..errors import InputError
from .entries import entry

_DEGREES = re.compile(r"\s*([-+0-9.eE]+)\s*deg\s*")


def parse_length(value: object, name: str) -> float:
    """A length [m] from a number or its text. name: of the entry or option. Raises InputError unless it is finite."""
    return _finite(value, f"{name} must be a number of meters, as in 0.8, not {value!r}")


def parse_angle(value: object, name: str) -> float:
    """An angle [rad] from a number or text in radians, or from text in degrees such as "20deg".

    name: of the entry or option. Raises InputError for anything else, and for radians beyond a full turn, which are
    probably degrees.
    """
    message = f"{name} must be an angle in radians, or in degrees as in 20deg, not {value!r}"
    degrees = _DEGREES.fullmatch(value) if isinstance(value, str) else None
    if degrees:
        return math.radians(_finite(degrees.group(1), message))
    radians = _finite(value, message)
    if abs(radians) > 2.0 * math.pi:
        raise InputError(f"{name} of {radians:g} rad is more than a full turn; did you mean {radians:g}deg?")
    return radians


def length(default: float | None, help: str) -> Any:
    """A configuration entry that holds a length [m]."""
    return entry(_checked_length, default, help, "m")


def angle(default: float | None, help: str) -> Any:
    """A configuration entry that holds an angle [rad]."""
    return entry(_checked_angle, default, help, "rad")


def _checked_length(entry: Field[Any], value: object) -> float:
    return parse_length(value, entry.name)


def _checked_angle(entry: Field[Any], value: object) -> float:
    return parse_angle(value, entry.name)


def _finite(value: object, message: str) -> float:
    """A value as a finite number. Raises InputError with the message."""
    try:
        number = math.nan if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(message)
    return number
