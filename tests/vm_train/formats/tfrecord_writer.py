"""Writes Examples and TFRecord files, as TensorFlow and protobuf do."""

import gzip
import struct
from contextlib import nullcontext

import google_crc32c

from vm_train.formats.importing import Example


def masked(data):
    """The checksum of some bytes in a TFRecord file, by its definition."""
    crc = google_crc32c.value(data)
    return struct.pack("<I", (((crc >> 15) | (crc << 17)) + 0xA282EAD8) % 2**32)


def framed(payload):
    """A record."""
    length = struct.pack("<Q", len(payload))
    return length + masked(length) + payload + masked(payload)


def write_records(path, payloads, compressed=False):
    """Write a TFRecord file, plain or gzip."""
    with path.open("wb") as file, gzip.open(file, "wb") if compressed else nullcontext(file) as stream:
        for payload in payloads:
            stream.write(framed(payload))


def example_bytes(features):
    """The payload of an Example with these features: lists of bytes or floats by name."""
    example = Example()
    for name, values in features.items():
        feature = example.features.feature[name]
        kind = feature.bytes_list if values and isinstance(values[0], bytes) else feature.float_list
        kind.value.extend(values)
    return example.SerializeToString()
