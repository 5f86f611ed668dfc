"""Lengths, angles and sizes as users write them: numbers, or text such as "0.6", "20deg" and "640x512"."""

from __future__ import annotations

import math
import re
from dataclasses import Field
from typing import Any

from ..errors import InputError
from .entries import Limits, entry

_LARGEST, _DIGITS = 20000, 9
"""Largest width and height of an image [px], and most digits that are read as a number."""

_DEGREES = re.compile(r"\s*([-+0-9.eE]+)\s*deg\s*")


def parse_length(value: object, name: str) -> float:
    """A length [m] from a number or its text. name: of the entry or option. Raises InputError unless it is finite."""
    return _finite(value, f"{name} must be a number of meters, as in 0.8, not {value!r}")


def parse_angle(value: object, name: str) -> float:
    """An angle [rad] from a number or text in radians, or from text in degrees such as "20deg".

    name: of the entry or option. Raises InputError for anything else, and for radians beyond a full turn, which are
    probably degrees.
    """
    radians = _radians(value, f"{name} must be an angle in radians, or in degrees as in 20deg, not {value!r}")
    if abs(radians) > 2.0 * math.pi and not _is_degrees(value):
        raise InputError(f"{name} of {radians:g} rad is more than a full turn; did you mean {radians:g}deg?")
    return radians


def parse_size(text: str) -> tuple[int, int]:
    """Width and height [px] from text such as "640x512". Raises InputError."""
    sides = text.lower().split("x")
    if len(sides) != 2 or not all(each.isascii() and each.isdecimal() and len(each) <= _DIGITS for each in sides):
        raise InputError(f"size must be WIDTHxHEIGHT in pixels, as 640x512, not {text!r}")
    width, height = int(sides[0]), int(sides[1])
    if not (2 <= width <= _LARGEST and 2 <= height <= _LARGEST):
        raise InputError(f"width and height must be from 2 to {_LARGEST} px, not {text!r}")
    return width, height


def length(default: float | None, help: str) -> Any:
    """A configuration entry that holds a length [m]."""
    return entry(_checked_length, default, help, "m")


def angle(default: float | None, help: str, limits: Limits) -> Any:
    """A configuration entry that holds an angle within limits [rad]."""
    return entry(_checked_angle, default, help, "rad", limits=limits)


def _checked_length(entry: Field[Any], value: object) -> float:
    return parse_length(value, entry.name)


def _checked_angle(entry: Field[Any], value: object) -> float:
    low, high = entry.metadata["limits"]
    message = f"{entry.name} must be an angle, as in 0.3 or 20deg, from {low:g} to {high:g} rad, not {value!r}"
    radians = _radians(value, message)
    if low <= radians <= high:
        return radians
    if not _is_degrees(value) and low <= math.radians(radians) <= high:
        message += f"; did you mean {radians:g}deg?"
    raise InputError(message)


def _is_degrees(value: object) -> bool:
    return isinstance(value, str) and _DEGREES.fullmatch(value) is not None


def _radians(value: object, message: str) -> float:
    """An angle [rad] from a number or text. Raises InputError with the message."""
    degrees = _DEGREES.fullmatch(value) if isinstance(value, str) else None
    return math.radians(_finite(degrees[1], message)) if degrees else _finite(value, message)


def _finite(value: object, message: str) -> float:
    """A value as a finite number. Raises InputError with the message."""
    try:
        number = math.nan if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(message)
    return number
