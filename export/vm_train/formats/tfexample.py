"""Examples, the payloads of TFRecord files: protobuf messages that map names to lists of bytes, floats or integers."""

from __future__ import annotations

from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, text_format
from google.protobuf.message import DecodeError

from vm_embedded.errors import InputError, one_line

_SCHEMA = """
name: "vm_train/example.proto" package: "vm_train" syntax: "proto3"
message_type { name: "BytesList" field { name: "value" number: 1 label: LABEL_REPEATED type: TYPE_BYTES } }
message_type { name: "FloatList" field { name: "value" number: 1 label: LABEL_REPEATED type: TYPE_FLOAT } }
message_type { name: "Int64List" field { name: "value" number: 1 label: LABEL_REPEATED type: TYPE_INT64 } }
message_type {
  name: "Feature"
  field { name: "bytes_list" number: 1 type_name: ".vm_train.BytesList" oneof_index: 0 }
  field { name: "float_list" number: 2 type_name: ".vm_train.FloatList" oneof_index: 0 }
  field { name: "int64_list" number: 3 type_name: ".vm_train.Int64List" oneof_index: 0 }
  oneof_decl { name: "kind" }
}
message_type {
  name: "Features"
  field { name: "feature" number: 1 label: LABEL_REPEATED type_name: ".vm_train.Features.FeatureEntry" }
  nested_type {
    name: "FeatureEntry"
    options { map_entry: true }
    field { name: "key" number: 1 type: TYPE_STRING }
    field { name: "value" number: 2 type_name: ".vm_train.Feature" }
  }
}
message_type { name: "Example" field { name: "features" number: 1 type_name: ".vm_train.Features" } }
"""
"""TensorFlow's example.proto and feature.proto, as a FileDescriptorProto."""

_POOL = descriptor_pool.DescriptorPool()
_POOL.Add(text_format.Parse(_SCHEMA, descriptor_pb2.FileDescriptorProto()))

Example = message_factory.GetMessageClass(_POOL.FindMessageTypeByName("vm_train.Example"))
"""The class of these messages; its `features.feature` maps names to messages with one of three lists."""


def parse_example(payload: bytes) -> Any:
    """The Example in a payload. Raises InputError if it holds none."""
    try:
        return Example.FromString(payload)
    except DecodeError as error:
        raise InputError(f"not an Example: {one_line(error)}") from error
