"""Writes Examples and TFRecord files, as TensorFlow and protobuf do."""

import gzip
import struct
from contextlib import nullcontext

from vm_embedded.files import atomic_write
from vm_train.formats.crc32c import masked_crc32c
from vm_train.formats.tfexample import BytesList, FloatList, Int64List

BYTES = 2
"""Wire type of protobuf."""


def write_records(path, payloads, compressed=False):
    """Write a TFRecord file, plain or gzip, atomically. Raises InputError if it can't be written."""
    with atomic_write(path) as part, part.open("wb") as file:
        # Without time and name: the same records give the same file. Level 1, as pictures are compressed already.
        packed = gzip.GzipFile("", "wb", compresslevel=1, fileobj=file, mtime=0) if compressed else nullcontext(file)
        with packed as stream:
            for payload in payloads:
                length = struct.pack("<Q", len(payload))
                stream.write(length + struct.pack("<I", masked_crc32c(length)))
                stream.write(payload)
                stream.write(struct.pack("<I", masked_crc32c(payload)))


def example_bytes(example):
    """The payload of an Example as protobuf writes it, with the features in the order of the mapping.

    Raises OverflowError for a number that does not fit into its list.
    """
    entries = (
        _field(1, _field(1, name.encode()) + _field(2, _feature_bytes(feature))) for name, feature in example.items()
    )
    return _field(1, b"".join(entries))


def _feature_bytes(feature):
    match feature:
        case BytesList(texts):
            return _field(1, b"".join(_field(1, each) for each in texts))
        case FloatList(floats):
            return _field(2, _field(1, struct.pack(f"<{len(floats)}f", *floats)) if floats else b"")
        case Int64List(integers):
            packed = b"".join(
                _varint_bytes(int.from_bytes(each.to_bytes(8, "little", signed=True), "little")) for each in integers
            )
            return _field(3, _field(1, packed) if integers else b"")


def _field(number, value):
    return _varint_bytes(number << 3 | BYTES) + _varint_bytes(len(value)) + value


def _varint_bytes(value):
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    return bytes(out)
