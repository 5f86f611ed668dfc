"""The binary form of messages: a header, then lists of records, then a text; all numbers little-endian.

It follows from the records of messages (borders/records.py): the same fields in the same order, each number with the
digits of the JSON form. docs/daemon.md shows the layout, with a reader.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any
from zlib import crc32

import numpy as np

from ..borders.records import Entry, Record, entries
from .messages import LiveFrame, Message

Field = tuple[str, str, tuple[int, ...]]
"""Name, type and shape, as numpy takes them."""


def is_list(entry: Entry) -> bool:
    """Whether a field of a frame is a list of records, also if it has at most one."""
    return entry.many is tuple or entry.sent.shape[:1] == (-1,) or (entry.is_record and entry.sent.null)


def number_type(entry: Entry) -> str:
    """The type of a field's numbers; empty for what the binary form lacks: free texts, constants, and any JSON."""
    if entry.type is float:
        return "<f8" if entry.sent.digits > 5 else "<f4"
    is_coded = entry.attribute == "class_name" or len(entry.sent.allowed) > 1
    return "<u4" if entry.type in (int, bool) or (entry.type is str and is_coded) else ""


def _frame_entries(record: type[Record]) -> Iterator[Entry]:
    """The fields of a frame; behind a part, such as the field, those of this part."""
    for each in entries(record):
        if each.is_record or number_type(each):
            yield each
        if each.is_record and not is_list(each):
            yield from _frame_entries(each.type)


def _fields(row: tuple[Entry, ...], prefix: str = "") -> Iterator[Field]:
    """The fields of a record; a part of it, such as a track, has the prefix of its name."""
    for each in row:
        if each.is_record:
            yield from _fields(entries(each.type), f"{each.name}_")
        elif kind := number_type(each):
            names = (len(each.sent.allowed),) if each.many else ()
            yield prefix + each.name, kind, names or each.sent.shape[each.sent.shape[:1] == (-1,) :]


ENTRIES = {each.name: each for each in _frame_entries(LiveFrame)}
"""The fields of a frame in the binary form, by name."""

_LISTS = {
    name: list(_fields(entries(each.type) if each.is_record else (each,)))
    for name, each in ENTRIES.items()
    if is_list(each)
}

_HEADER: list[Field] = [
    *((name, "<u4", ()) for name in ("length", "layout", "is_frame")),
    *(
        (name, "<u4", ()) if name in _LISTS or each.is_record else next(_fields((each,)))
        for name, each in ENTRIES.items()
    ),
    ("text", "<u4", ()),
]

HEADER = np.dtype(_HEADER)
"""length: bytes that follow it. layout: LAYOUT. is_frame: 0 for a state. Then the fields of a frame: of a list, the
number of its records; of a part, whether it is there. text: bytes of the text."""

RECORDS = {name: np.dtype(fields) for name, fields in _LISTS.items()}
"""The type of the records of each list, in the order of a message."""

LAYOUT = crc32(repr((_HEADER, _LISTS, [each.sent.allowed for each in ENTRIES.values()])).encode())
"""A number that changes with the layout."""


def to_binary(message: Message) -> bytes:
    """A message of a live detector in the binary form. `truth` is left out.

    The text has the names of the frame's classes, one per line, or the reason of a state.
    """
    values = message | message.get("field", {})
    codes: dict[str, int] = {}
    lists = {
        name: np.array(list(_rows(ENTRIES[name], values.get(name), codes)), kind) for name, kind in RECORDS.items()
    }
    text = message.get("reason", "\n".join(codes)).encode()
    body = b"".join([*(each.tobytes() for each in lists.values()), text])
    head = np.zeros((), HEADER)
    head["length"] = HEADER.itemsize - 4 + len(body)
    head["layout"], head["is_frame"], head["text"] = LAYOUT, message["type"] == "frame", len(text)
    for name, each in ENTRIES.items():
        if name in lists:
            head[name] = len(lists[name])
        else:
            head[name] = name in message if each.is_record else _number(each, values.get(name), codes)
    return head.tobytes() + body


def _rows(entry: Entry, value: Any, codes: dict[str, int]) -> Iterator[tuple[Any, ...]]:
    """The records of a list. codes: number of each class name; it gets the new ones."""
    if value is None:
        return
    if not entry.is_record:
        yield from ((each,) for each in value)
    elif entry.many:
        yield from (tuple(_row(entry.type, each, codes)) for each in value)
    elif all(each.sent.shape[:1] == (-1,) for each in entries(entry.type)):
        yield from zip(*value.values(), strict=True)
    else:
        yield tuple(_row(entry.type, value, codes))


def _row(record: type[Record], value: Mapping[str, Any], codes: dict[str, int]) -> Iterator[Any]:
    """The values of a record; of a part that is not there, 0 and NaN."""
    for each in entries(record):
        if each.is_record:
            yield from _row(each.type, value.get(each.name, {}), codes)
        elif number_type(each):
            yield _number(each, value.get(each.name), codes)


def _number(entry: Entry, value: Any, codes: dict[str, int]) -> Any:
    """The number, or numbers, of a field; 0 or NaN if it is not there."""
    if value is None:
        return math.nan if entry.type is float else 0
    if entry.many:
        return [value.get(name, math.nan) for name in entry.sent.allowed]
    if entry.type is str:
        return entry.sent.allowed.index(value) if entry.sent.allowed else codes.setdefault(value, len(codes))
    return value % 2**32 if entry.type is int else value
