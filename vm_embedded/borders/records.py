"""Records: what messages are made of. The table of a message is its class; nothing else lists its fields.

A record is a frozen dataclass. Its fields, and the results of its properties, whose type has a `Sent` are in messages,
in this order; the others are for Python only. The docstring gives shape, unit and meaning of each. From that follow
`as_dict`, the binary form, and in the documentation the JSON Schema, the structures of C++ and the tables.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np


@dataclass(frozen=True)
class Sent:
    """How a field is sent.

    digits: of its numbers behind the point; from 6 on, the binary form has double precision. shape: of its numbers; -1
    for any number of rows. least, most: of its numbers. allowed: texts, or names in a table. name: in messages, if it
    differs. null: None, and NaN in an array, are sent as null; otherwise a field that is None is left out.
    """

    digits: int = 3
    shape: tuple[int, ...] = ()
    least: float | None = None
    most: float | None = None
    allowed: tuple[str, ...] = ()
    name: str = ""
    null: bool = False


SHARE, SIZE = Sent(least=0, most=1), Sent(least=0)


@dataclass(frozen=True)
class Entry:
    """A field in messages: its name there, its name in Python, and how it is sent.

    type: of each value: float, int, bool, str, a class of records, or None for any JSON. many: tuple for a list of
    records, dict for a table of values by name; None for one value, also for an array of numbers. may_lack: whether it
    can be None.
    """

    name: str
    attribute: str
    sent: Sent
    type: Any
    many: type | None
    may_lack: bool

    @property
    def is_record(self) -> bool:
        """Whether its values are records."""
        return isinstance(self.type, type) and issubclass(self.type, Record)


class Record:
    """A base of frozen dataclasses that messages are made of."""

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON by their names in messages, with rounded numbers."""
        found = {}
        for each in entries(type(self)):
            value = getattr(self, each.attribute)
            if value is not None or each.sent.null:
                found[each.name] = value if each.type is None else _plain(value, each.sent)
        return found


def entries(record: type[Record]) -> tuple[Entry, ...]:
    """The fields of a class of records that are in messages."""
    if record not in _TABLES:
        _TABLES[record] = _table(record)
    return _TABLES[record]


_TABLES: dict[type[Record], tuple[Entry, ...]] = {}


def _table(record: type[Record]) -> tuple[Entry, ...]:
    hints = get_type_hints(record, include_extras=True)
    for name, member in vars(record).items():
        if isinstance(member, property):
            hints[name] = get_type_hints(member.fget, include_extras=True)["return"]
    return tuple(
        _entry(name, get_args(hint)[0], sent)
        for name, hint in hints.items()
        for sent in getattr(hint, "__metadata__", ())
        if isinstance(sent, Sent)
    )


def _entry(attribute: str, hint: Any, sent: Sent) -> Entry:
    may_lack = type(None) in get_args(hint)
    if may_lack:
        (hint,) = (each for each in get_args(hint) if each is not type(None))
    is_list = get_origin(hint) is tuple and not sent.shape
    many = dict if get_origin(hint) is Mapping else tuple if is_list else None
    return Entry(sent.name or attribute, attribute, sent, _innermost(hint), many, may_lack)


def _innermost(hint: Any) -> Any:
    """The type of each value in tuples, tables and arrays of any depth."""
    if inner := [each for each in get_args(hint) if each is not Ellipsis]:
        return _innermost(inner[-1])
    if hint is Any:
        return None
    return float if isinstance(hint, type) and issubclass(hint, np.floating) else hint


def _plain(value: Any, sent: Sent) -> Any:
    if isinstance(value, Record):
        return value.as_dict()
    if isinstance(value, Mapping):
        return {name: _plain(each, sent) for name, each in value.items()}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(each, sent) for each in value]
    if isinstance(value, float):
        return None if sent.null and math.isnan(value) else round(value, sent.digits)
    return value
