"""The messages of ROS 2 as classes of the package cyclonedds, made from their fields."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl

from vm_embedded.cameras.ros.message_fields import FIELDS, fields_of, short_name

from .cdr import encode
from .plain_messages import with_arrays

_PRIMITIVES: dict[str, Any] = {
    "bool": bool,
    "byte": idl.uint8,
    "uint8": idl.uint8,
    "int32": idl.int32,
    "uint32": idl.uint32,
    "float32": idl.float32,
    "float64": idl.float64,
    "string": str,
}


def message_classes() -> SimpleNamespace:
    """The classes of all messages by their short names, and functions that make their arrays."""
    classes: dict[str, Any] = {}
    for full in FIELDS:
        package, _, name = full.split("/")
        classes[short_name(full)] = _message_class(full, f"{package}::msg::dds_::{name}_", classes)
    return with_arrays(classes)


def _message_class(full: str, dds_name: str, classes: dict[str, Any]) -> Any:
    """The class of a message. classes: those that it may contain."""
    name = full.rpartition("/")[2]
    types = {field: _type(kind, classes) for kind, field in fields_of(full)}
    made: Any = make_idl_struct(name, dds_name, types)
    made.serialize = lambda self, *_, **__: encode(short_name(full), self)
    octets = [field for kind, field in fields_of(full) if kind == "uint8[]"]
    if octets:
        # cyclonedds reads octets as a list of numbers, which takes a hundred times as long as bytes. But it can't
        # describe bytes to other participants, so that only the decoding is that of a class with bytes.
        made.deserialize = make_idl_struct(name, dds_name, {**types, **dict.fromkeys(octets, bytes)}).deserialize
    return made


def _type(kind: str, classes: dict[str, Any]) -> Any:
    """The type of a field: primitive, message, sequence or array."""
    found = re.fullmatch(r"(\w+)(\[(\d*)\])?", kind)
    assert found is not None, kind
    single = _PRIMITIVES.get(found[1]) or classes[found[1]]
    if found[2] is None:
        return single
    array: Any = idl.array
    sequence: Any = idl.sequence
    return array[single, int(found[3])] if found[3] else sequence[single]
