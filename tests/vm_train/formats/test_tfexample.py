"""Examples of TensorFlow: read byte for byte as it writes them, and every fault by name."""

import struct
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_train.formats.importing import parse_example

from .tfrecord_writer import example_bytes


def part(tag, content):
    """A field of a message: its tag, its length and its value."""
    return bytes([tag, len(content)]) + content


def entry(name, feature):
    return part(0x0A, part(0x0A, name) + part(0x12, feature))


BUILT = part(
    0x0A,
    entry(b"count", part(0x1A, part(0x0A, b"\x07")))
    + entry(b"ratio", part(0x12, part(0x0A, struct.pack("<f", 0.5))))
    + entry(b"word", part(0x0A, part(0x0A, b"abc"))),
)
"""A serialized example of a number, a fraction and a text."""


def test_an_example_built_by_hand_is_read():
    found = parse_example(BUILT).features.feature
    assert sorted(found) == ["count", "ratio", "word"]
    assert list(found["count"].int64_list.value) == [7]
    assert list(found["ratio"].float_list.value) == [0.5]
    assert list(found["word"].bytes_list.value) == [b"abc"]


def test_what_tensorflow_writes_for_lists_is_what_the_tests_write():
    assert example_bytes({"word": [b"abc"]}) == part(0x0A, entry(b"word", part(0x0A, part(0x0A, b"abc"))))
    halves = part(0x12, part(0x0A, struct.pack("<2f", 0.5, 0.25)))
    assert example_bytes({"ratio": [0.5, 0.25]}) == part(0x0A, entry(b"ratio", halves))


@given(st.integers(0, len(BUILT) - 1), st.integers(0, 255))
def test_an_example_with_any_wrong_byte_is_an_example_or_a_named_fault(place, value):
    with suppress(InputError):
        parse_example(BUILT[:place] + bytes([value]) + BUILT[place + 1 :])


@pytest.mark.parametrize("payload", [b"\x0b", BUILT[:-1], b"\xff" * 20])
def test_bytes_that_are_no_example_are_a_fault(payload):
    with pytest.raises(InputError, match="not an Example: "):
        parse_example(payload)
