"""TFRecord files: the format to the bit, every fault by name."""

import gzip
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_train.formats.tfrecord import read_records

from .tfrecord_writer import framed, masked, write_records


def payloads_of(path):
    return [record.payload for record in read_records(path)]


def test_a_record_built_by_hand_is_read_and_written(tmp_path):
    # What TensorFlow begins an event file of the time 256.5 s with.
    payload = b"\x09" + struct.pack("<d", 256.5) + b"\x1a\x0dbrain.Event:2"
    known = bytes.fromhex("1800000000000000 a37f4b22") + payload + bytes.fromhex("bc98212b")
    (tmp_path / "known").write_bytes(known)
    assert payloads_of(tmp_path / "known") == [payload]
    write_records(tmp_path / "written", [payload])
    assert (tmp_path / "written").read_bytes() == known == framed(payload)


@given(st.lists(st.binary(max_size=600), max_size=5), st.booleans())
def test_what_is_written_is_read(tmp_path_factory, payloads, compressed):
    path = tmp_path_factory.mktemp("records") / "file"
    write_records(path, iter(payloads), compressed)
    assert payloads_of(path) == payloads
    assert [record.where for record in read_records(path)] == [f"{path}: record {n}" for n in range(len(payloads))]


def test_a_plain_file_that_begins_like_gzip_is_read_as_it_is(tmp_path):
    payload = bytes(0x088B1F)
    write_records(tmp_path / "file", [payload])
    assert (tmp_path / "file").read_bytes()[:3] == b"\x1f\x8b\x08"
    assert payloads_of(tmp_path / "file") == [payload]


def test_an_empty_file_has_no_records(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    assert payloads_of(tmp_path / "file") == []


def test_the_share_that_was_read_ends_at_1(tmp_path):
    write_records(tmp_path / "file", [b"a" * 100, b"b" * 50])
    assert [record.share for record in read_records(tmp_path / "file")] == [116 / 182, 1.0]


def test_records_are_read_one_at_a_time(tmp_path):
    (tmp_path / "file").write_bytes(framed(b"good") + b"rubbish that is no record")
    assert next(read_records(tmp_path / "file")).payload == b"good"


@pytest.mark.parametrize("size", [*range(1, 20), *range(21, 41)])
def test_a_file_that_breaks_off_is_named_with_the_record(tmp_path, size):
    path = tmp_path / "file"
    path.write_bytes((framed(b"good") + framed(b"lacks"))[:size])
    with pytest.raises(InputError) as error:
        payloads_of(path)
    fault = "is not a TFRecord file" if size < 12 else f"is cut short in record {int(size > 20)}"
    assert str(error.value).startswith(str(path))
    assert fault in str(error.value)


@given(st.integers(0, 19), st.integers(1, 255))
def test_any_damaged_byte_is_found(tmp_path_factory, place, change):
    path = tmp_path_factory.mktemp("records") / "file"
    data = bytearray(framed(b"good") + framed(b"next"))
    data[20 + place] ^= change
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"is damaged: the checksum of its (length|content) is wrong"):
        payloads_of(path)


def test_what_follows_a_damaged_payload_can_still_be_read(tmp_path):
    data = bytearray(framed(b"good") + framed(b"next"))
    data[13] ^= 1
    (tmp_path / "file").write_bytes(data)
    first, second = read_records(tmp_path / "file")
    with pytest.raises(InputError, match="it is damaged: the checksum of its content"):
        _ = first.payload
    assert second.payload == b"next"


def test_a_file_of_another_kind_is_told(tmp_path):
    for content in (b"\x89PNG\r\n\x1a\n" + bytes(100), b"short", gzip.compress(b"no record, only some text")):
        (tmp_path / "file").write_bytes(content)
        with pytest.raises(InputError, match="is not a TFRecord file"):
            payloads_of(tmp_path / "file")


def test_a_length_that_no_example_has_does_not_ask_for_memory(tmp_path):
    length = struct.pack("<Q", 2**62)
    (tmp_path / "file").write_bytes(length + masked(length))
    with pytest.raises(InputError, match="record 0 has 4611686018427387904 bytes"):
        payloads_of(tmp_path / "file")


def test_a_gzip_file_that_breaks_off_or_is_damaged_is_named(tmp_path):
    path = tmp_path / "file"
    write_records(path, [np.random.default_rng(1).bytes(1000), b"second"], compressed=True)
    whole = path.read_bytes()
    path.write_bytes(whole[:500])
    with pytest.raises(InputError, match="is cut short in record 0"):
        payloads_of(path)
    path.write_bytes(whole[:-6] + b"\0\0" + whole[-4:])
    with pytest.raises(InputError, match=f"{path}: .*gzip file is damaged"):
        payloads_of(path)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"can't read .*absent"):
        payloads_of(tmp_path / "absent")
