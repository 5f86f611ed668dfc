"""Examples, the payloads of TFRecord files, read without TensorFlow or protobuf.

An Example is a protobuf message that maps names to lists of bytes, floats or whole numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from vm_embedded.errors import InputError


@dataclass(frozen=True)
class BytesList:
    """Values of a feature of type bytes."""

    values: tuple[bytes, ...]


@dataclass(frozen=True)
class FloatList:
    """Values of a feature of type float; the file stores 32 bits of each."""

    values: tuple[float, ...]


@dataclass(frozen=True)
class Int64List:
    """Values of a feature of type int64."""

    values: tuple[int, ...]


Feature = BytesList | FloatList | Int64List
Example = Mapping[str, Feature]


_MOST = 2**22
"""Most values in an Example; a field counts as _FIELD values, as it takes so much more memory than a number."""

_FIELD = 4

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
"""Wire types of protobuf."""


def parse_example(payload: bytes) -> Example:
    """The features of an Example by name, without those that have no list.

    It follows the rules of protobuf: lists of numbers may be packed, unknown fields are ignored, and the parts of a
    message are merged. Raises InputError if the payload is not an Example, or has more than _MOST values.
    """
    example: dict[str, Feature] = {}
    budget = _Budget()
    for entry in _inner(_joined(_inner(memoryview(payload), 1, budget)), 1, budget):
        name = _text(_joined(_inner(entry, 1, budget)[-1:]))
        try:
            feature = _feature(_joined(_inner(entry, 2, budget)), budget)
        except InputError as error:
            raise InputError(f"{name!r}: {error}") from error
        if feature is not None:
            example[name] = feature
    return example


class _Budget:
    """The values that an Example may still have."""

    def __init__(self) -> None:
        self._left = _MOST

    def take(self, count: int) -> None:
        """Raises InputError if there are not so many left."""
        self._left -= count
        if self._left < 0:
            raise _no_example(f"it has more than {_MOST} values")


def _feature(message: memoryview, budget: _Budget) -> Feature | None:
    lists = [_inner(message, number, budget) for number in (1, 2, 3)]
    if sum(bool(each) for each in lists) > 1:
        raise _no_example("a feature has lists of several kinds")
    texts, floats, integers = (_joined(each) for each in lists)
    if lists[0]:
        return BytesList(tuple(bytes(each) for each in _inner(texts, 1, budget)))
    if lists[1]:
        return FloatList(_floats(floats, budget))
    if lists[2]:
        return Int64List(_integers(integers, budget))
    return None


def _floats(message: memoryview, budget: _Budget) -> tuple[float, ...]:
    parts = []
    for number, wire, value in _fields(message, budget):
        if number == 1:
            if not isinstance(value, memoryview) or wire == _FIXED64 or len(value) % 4:
                raise _no_example("a list of floats holds something else")
            budget.take(len(value) // 4)
            parts.append(value)
    return tuple(np.frombuffer(b"".join(parts), dtype="<f4").tolist())


def _integers(message: memoryview, budget: _Budget) -> tuple[int, ...]:
    values: list[int] = []
    for number, wire, value in _fields(message, budget):
        if number != 1:
            continue
        if isinstance(value, int):
            values.append(value)
        elif wire == _BYTES:
            at = 0
            while at < len(value):
                each, at = _varint(value, at)
                budget.take(1)
                values.append(each)
        else:
            raise _no_example("a list of whole numbers holds something else")
    return tuple(each - 2**64 if each >= 2**63 else each for each in values)


def _inner(message: memoryview, wanted: int, budget: _Budget) -> list[memoryview]:
    """All values of a field of type bytes, text or message."""
    found = []
    for number, wire, value in _fields(message, budget):
        if number == wanted:
            if wire != _BYTES or isinstance(value, int):
                raise _no_example(f"field {number} has wire type {wire}")
            found.append(value)
    return found


def _joined(parts: list[memoryview]) -> memoryview:
    """A message from its parts: to merge messages, protobuf concatenates their bytes."""
    return parts[0] if len(parts) == 1 else memoryview(b"".join(parts))


def _text(value: memoryview) -> str:
    try:
        return str(value, "utf-8")
    except UnicodeDecodeError as error:
        raise _no_example("the name of a feature is not text") from error


def _fields(message: memoryview, budget: _Budget) -> Iterator[tuple[int, int, int | memoryview]]:
    """Number, wire type and value of each field. The value is a number for _VARINT, otherwise bytes."""
    at = 0
    while at < len(message):
        budget.take(_FIELD)
        tag, at = _varint(message, at)
        number, wire = tag >> 3, tag & 7
        if not 1 <= number < 2**29:
            raise _no_example(f"field number {number} is out of range")
        if wire == _VARINT:
            value, at = _varint(message, at)
            yield number, wire, value
            continue
        if wire == _BYTES:
            size, at = _varint(message, at)
        elif wire in (_FIXED32, _FIXED64):
            size = 4 if wire == _FIXED32 else 8
        else:
            raise _no_example(f"unknown wire type {wire}")
        if size > len(message) - at:
            raise _no_example("it is cut short")
        yield number, wire, message[at : at + size]
        at += size


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """The number below 2^64 at position `at`, and the position after it."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(message):
            raise _no_example("it is cut short")
        byte = message[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            break
    else:
        raise _no_example("a number is too long")
    if value >= 2**64:
        raise _no_example("a number is too large")
    return value, at


def _no_example(reason: str) -> InputError:
    return InputError(f"not an Example: {reason}")
