"""Serialized examples of TensorFlow: read and written as protobuf does, every fault by name."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_train.formats.tfexample import BytesList, FloatList, Int64List, parse_example
from vm_train.formats.tfrecord import read_records

from .tfrecord_writer import example_bytes, write_records


def part(tag, content):
    """A part of a message: its tag, its length and what it holds."""
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

FEATURES = st.one_of(
    st.lists(st.binary(max_size=300), max_size=4).map(lambda values: BytesList(tuple(values))),
    st.lists(st.floats(width=32, allow_nan=False), max_size=20).map(lambda values: FloatList(tuple(values))),
    st.lists(st.integers(-(2**63), 2**63 - 1), max_size=20).map(lambda values: Int64List(tuple(values))),
)
EXAMPLES = st.dictionaries(st.text(max_size=20), FEATURES, max_size=6)


def test_an_example_built_by_hand_is_read_and_written():
    example = parse_example(BUILT)
    assert example == {"count": Int64List((7,)), "ratio": FloatList((0.5,)), "word": BytesList((b"abc",))}
    assert example_bytes(example) == BUILT


@given(EXAMPLES)
def test_an_example_that_is_written_is_read(example):
    assert parse_example(example_bytes(example)) == example


@pytest.fixture(scope="module")
def example_type():
    """The Example of the protobuf package."""
    descriptor_pb2 = pytest.importorskip("google.protobuf.descriptor_pb2")
    from google.protobuf import descriptor_pool, message_factory

    file = descriptor_pb2.FileDescriptorProto(name="example.proto", package="t", syntax="proto3")

    def message(name, *fields):
        made = file.message_type.add(name=name)
        for number, (label, kind, field) in enumerate(fields, start=1):
            simple = {"bytes": 12, "float": 2, "int64": 3}.get(kind)
            made.field.add(
                name=field, number=number, label=label, type=simple or 11, type_name=None if simple else f".t.{kind}"
            )
        return made

    for name, kind in (("BytesList", "bytes"), ("FloatList", "float"), ("Int64List", "int64")):
        message(name, (3, kind, "value"))
    feature = message("Feature", (1, "BytesList", "bytes"), (1, "FloatList", "floats"), (1, "Int64List", "ints"))
    feature.oneof_decl.add(name="kind")
    for field in feature.field:
        field.oneof_index = 0
    features = message("Features", (3, "Features.FeatureEntry", "feature"))
    entry = features.nested_type.add(name="FeatureEntry")
    entry.options.map_entry = True
    entry.field.add(name="key", number=1, label=1, type=9)
    entry.field.add(name="value", number=2, label=1, type=11, type_name=".t.Feature")
    message("Example", (1, "Features", "features"))
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("t.Example"))


@given(example=EXAMPLES)
def test_protobuf_reads_and_writes_the_same(example_type, example):
    read = example_type.FromString(example_bytes(example))
    names = {BytesList: "bytes", FloatList: "floats", Int64List: "ints"}
    assert set(read.features.feature) == set(example)
    for name, feature in example.items():
        assert read.features.feature[name].HasField(names[type(feature)])
        assert tuple(getattr(read.features.feature[name], names[type(feature)]).value) == feature.values
    assert parse_example(read.SerializeToString()) == example


def in_feature(content):
    """A payload with one feature, `x`, of these bytes."""
    entry = b"\n\x01x\x12" + bytes([len(content)]) + content
    features = b"\n" + bytes([len(entry)]) + entry
    return b"\n" + bytes([len(features)]) + features


@given(st.lists(st.floats(width=32, allow_nan=False), max_size=10), st.lists(st.integers(0, 127), max_size=10))
def test_lists_that_are_not_packed_are_read(floats, integers):
    loose = b"".join(b"\x0d" + struct.pack("<f", each) for each in floats)
    assert parse_example(in_feature(b"\x12" + bytes([len(loose)]) + loose)) == {"x": FloatList(tuple(floats))}
    loose = b"".join(b"\x08" + bytes([each]) for each in integers)
    assert parse_example(in_feature(b"\x1a" + bytes([len(loose)]) + loose)) == {"x": Int64List(tuple(integers))}


def test_a_list_partly_packed_is_read_in_order():
    one, two, three = (struct.pack("<f", each) for each in (1, 2, 3))
    content = b"\x0d" + one + b"\n\x08" + two + three
    assert parse_example(in_feature(b"\x12" + bytes([len(content)]) + content)) == {"x": FloatList((1.0, 2.0, 3.0))}


def test_fields_of_later_versions_are_passed_over():
    later = b"\x78\x96\x01" + b"\x7a\x02hi" + b"\x7d\0\0\0\0" + b"\x79" + bytes(8)
    assert parse_example(later + BUILT + later) == parse_example(BUILT)


@given(EXAMPLES, EXAMPLES)
def test_a_message_in_parts_is_the_sum_of_its_parts(first, second):
    assert parse_example(example_bytes(first) + example_bytes(second)) == {**first, **second}


def test_a_feature_without_a_list_is_left_out():
    assert parse_example(in_feature(b"")) == {}


def fault_of(payload):
    """What is wrong with a payload; None if it is an Example."""
    try:
        parse_example(payload)
    except InputError as error:
        return str(error)
    return None


@given(st.binary(max_size=60))
def test_any_bytes_are_an_example_or_a_named_fault(data):
    fault = fault_of(data)
    assert fault is None or "not an Example: " in fault


@given(st.integers(0, len(BUILT) - 1), st.integers(0, 255))
def test_an_example_with_any_wrong_byte_is_an_example_or_a_named_fault(place, value):
    fault = fault_of(BUILT[:place] + bytes([value]) + BUILT[place + 1 :])
    assert fault is None or "not an Example: " in fault


def test_a_record_that_is_no_example_is_named_with_file_and_number(tmp_path):
    write_records(tmp_path / "file", [BUILT, b"\x0b"])
    first, second = read_records(tmp_path / "file")
    assert first.example() == parse_example(BUILT)
    with pytest.raises(InputError, match="file: record 1: not an Example: unknown wire type 3"):
        second.example()


def test_numbers_that_a_list_can_not_hold_are_refused():
    for feature in (FloatList((1e300,)), Int64List((2**63,))):
        with pytest.raises(OverflowError):
            example_bytes({"x": feature})
