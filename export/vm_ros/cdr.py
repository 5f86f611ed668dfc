"""Encode messages as ROS 2 sends them: CDR of XTypes 1, little-endian.

The packages cyclonedds and rclpy encode, too, but take several times as long.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from functools import cache
from operator import attrgetter
from typing import Any

from vm_embedded.cameras.ros.message_fields import MESSAGES, fields_of

_CODES = {"bool": "?", "byte": "B", "uint8": "B", "int32": "i", "uint32": "I", "float32": "f", "float64": "d"}

_Encode = Callable[[bytearray, Any], None]
"""Adds a value to what is encoded so far, from where alignment counts."""


def encode(name: str, message: Any) -> bytes:
    """The bytes of a message with a short name."""
    out = bytearray()
    _message(name)(out, message)
    return b"\0\1\0\0" + bytes(out)


@cache
def _message(name: str) -> _Encode:
    if _flat(name):
        sequence = _sequence(name)
        return lambda out, message: sequence(out, [message])
    parts = [(field, _field(kind)) for kind, field in fields_of(MESSAGES[name])]

    def add(out: bytearray, message: Any) -> None:
        for field, add_field in parts:
            add_field(out, getattr(message, field))

    return add


@cache
def _flat(name: str) -> tuple[str, list[str]] | None:
    """Codes and paths of the numbers of a message that has nothing else, all of one size; None for others."""
    codes, paths = "", []
    for kind, field in fields_of(MESSAGES[name]):
        inner = (_CODES[kind], [""]) if kind in _CODES else _flat(kind) if kind in MESSAGES else None
        if inner is None:
            return None
        codes += inner[0]
        paths += [f"{field}.{path}".rstrip(".") for path in inner[1]]
    return (codes, paths) if len(paths) > 1 and len({struct.calcsize(each) for each in codes}) == 1 else None


def _field(kind: str) -> _Encode:
    found = re.fullmatch(r"(\w+)(\[(\d*)\])?", kind)
    assert found is not None, kind
    single, brackets, size = found.groups()
    if kind == "string":
        return _add_text
    if brackets is None:
        return _numbers(single, False) if single in _CODES else _message(single)
    return _counted(_numbers(single, True) if single in _CODES else _sequence(single), bool(size))


def _counted(add: _Encode, fixed: bool) -> _Encode:
    def added(out: bytearray, values: Any) -> None:
        if not fixed:
            _align(out, 4)
            out += struct.pack("<I", len(values))
        if len(values):
            add(out, values)

    return added


def _numbers(kind: str, several: bool) -> _Encode:
    code = _CODES[kind]
    size = struct.calcsize(code)

    def add(out: bytearray, values: Any) -> None:
        _align(out, size)
        if code == "B" and several:
            out += bytes(values)
        else:
            out += struct.pack(f"<{len(values)}{code}", *values) if several else struct.pack(f"<{code}", values)

    return add


def _sequence(name: str) -> _Encode:
    """Encodes messages one after another."""
    flat = _flat(name)
    if flat is None:
        one = _message(name)

        def each(out: bytearray, messages: Any) -> None:
            for message in messages:
                one(out, message)

        return each
    codes, get = flat[0], attrgetter(*flat[1])
    size = struct.calcsize(codes[0])

    def add(out: bytearray, messages: Any) -> None:
        _align(out, size)
        values = [value for message in messages for value in get(message)]
        out += struct.pack("<" + len(messages) * codes, *values)

    return add


def _add_text(out: bytearray, text: str) -> None:
    encoded = text.encode() + b"\0"
    _align(out, 4)
    out += struct.pack("<I", len(encoded)) + encoded


def _align(out: bytearray, size: int) -> None:
    out += bytes(-len(out) % size)
