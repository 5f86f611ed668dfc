"""Lengths and angles as users write them: numbers, or text such as "0.6" and "20deg"."""

from __future__ import annotations

import math
import re
from dataclasses import Field
from typing import Any

from ..errors import InputError
from .entries import entry

_DEGREES = re.compile(r"\s*([-+0-9.eE]+)\s*deg\s*")


def parse_length(value: object) -> float:
    """A length [m] from a number or its text. Raises InputError unless it is finite."""
    return _finite(value, f"{value!r} is not a number of meters")


def parse_angle(value: object) -> float:
    """An angle [rad] from a number or text in radians, or from text in degrees such as "20deg".

    Raises InputError for anything else, and for radians beyond a full turn, which are probably degrees.
    """
    message = f"{value!r} is not an angle; write radians, or degrees as in 20deg"
    degrees = _DEGREES.fullmatch(value) if isinstance(value, str) else None
    if degrees:
        return math.radians(_finite(degrees.group(1), message))
    radians = _finite(value, message)
    if abs(radians) > 2.0 * math.pi:
        raise InputError(f"{radians:g} rad is more than a full turn; did you mean {radians:g}deg?")
    return radians


def length(default: float | None, help: str) -> Any:
    """A configuration entry that holds a length [m]."""
    return entry(_checked_length, default, help, "m")


def angle(default: float | None, help: str) -> Any:
    """A configuration entry that holds an angle [rad]."""
    return entry(_checked_angle, default, help, "rad")


def _checked_length(_: Field[Any], value: object) -> float:
    return parse_length(value)


def _checked_angle(_: Field[Any], value: object) -> float:
    return parse_angle(value)


def _finite(value: object, message: str) -> float:
    """A value as a finite number. Raises InputError with the message."""
    try:
        number = math.nan if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(message)
    return number
