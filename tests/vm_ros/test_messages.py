"""The bytes of all messages are those of ROS, as the library rosbags writes and reads them."""

from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.cameras.ros.bag_types import bag_types, typestore
from vm_embedded.cameras.ros.message_fields import FIELDS, MESSAGES, fields_of, short_name
from vm_ros.cdr import encode
from vm_ros.dds_middleware import message_classes
from vm_ros.plain_messages import plain_classes

DDS, PLAIN = message_classes(), plain_classes(map(short_name, FIELDS))
BAG = bag_types()
STORE = typestore()

NUMBERS = {
    "bool": st.booleans(),
    "byte": st.integers(0, 127),
    "uint8": st.integers(0, 255),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "float32": st.floats(allow_nan=False, width=32),
    "float64": st.floats(allow_nan=False),
    "string": st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=9),
}


def contents(full):
    """Random contents of a message, as dictionaries."""
    return st.fixed_dictionaries({name: content(kind) for kind, name in fields_of(full)})


def content(kind):
    single, _, count = kind.rstrip("]").partition("[")
    one = NUMBERS[single] if single in NUMBERS else contents(MESSAGES[single])
    if "[" not in kind:
        return one
    return st.lists(one, min_size=int(count or 0), max_size=int(count or 3))


def made(types, full, values):
    """The message of a set of types with these contents."""
    filled = {}
    for kind, name in fields_of(full):
        single, value = kind.partition("[")[0], values[name]
        if kind == "uint8[]":
            filled[name] = types.octets(bytes(value))
        elif kind.startswith("float64["):
            filled[name] = types.doubles(value)
        elif kind == "byte" and isinstance(types.DiagnosticStatus.OK, bytes):
            filled[name] = bytes([value])  # in rclpy
        elif single in NUMBERS:
            filled[name] = value
        elif "[" in kind:
            filled[name] = [made(types, MESSAGES[single], each) for each in value]
        else:
            filled[name] = made(types, MESSAGES[single], value)
    return getattr(types, short_name(full))(**filled)


def plain(message):
    """A message as dictionaries and lists."""
    if is_dataclass(message):
        names = [each.name for each in fields(message) if each.name[0].islower()]  # rosbags adds constants
        return {name: plain(getattr(message, name)) for name in names}
    if isinstance(message, np.ndarray | bytes):
        return list(message)
    return [plain(each) for each in message] if isinstance(message, list | tuple) else message


@pytest.mark.parametrize("full", FIELDS)
def test_each_message_has_the_bytes_of_ros(full):
    @given(contents(full))
    def check(values):
        encoded = made(DDS, full, values).serialize()
        assert encode(short_name(full), made(PLAIN, full, values)) == encoded
        assert encoded == bytes(STORE.serialize_cdr(made(BAG, full, values), full))
        assert plain(STORE.deserialize_cdr(encoded, full)) == values
        assert plain(getattr(DDS, short_name(full)).deserialize(encoded)) == values

    check()


def test_the_levels_of_diagnostics_are_those_of_ros():
    for name in ("OK", "WARN", "ERROR"):
        levels = {getattr(each.DiagnosticStatus, name) for each in (DDS, PLAIN, BAG)}
        assert len(levels) == 1
