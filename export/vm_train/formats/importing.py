"""Import of pictures from tar archives, and from TFRecord files of the reference implementation, into a folder.

Archives keep the numbers of their pictures. A TFRecord file has none: each record gives image0000012.jpg or .png and
mask0000012.png, with the bytes that the record holds, and lens0000012.yaml. The number counts the records of all files
from 0, so a skipped record leaves a gap, and an import that was stopped can continue.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, text_format
from google.protobuf.message import DecodeError

from vm_embedded.errors import InputError, VisualMeshError, one_line

from ..data.picture_files import FileName
from .picture_example import WrongUnitError, picture_of
from .picture_folder import PictureFolder
from .shards import check_readable, import_shard, is_shard
from .tfrecord import read_records


@dataclass(frozen=True)
class Imported:
    """The result of an import.

    count: pictures that it wrote or completed. there: pictures that the folder had before. skipped: a line for each
    record without a usable picture, and each picture that lacks a file. remarks: further lines.
    """

    count: int
    there: int
    skipped: tuple[str, ...]
    remarks: tuple[str, ...]


def import_pictures(
    files: Sequence[str],
    out: Path,
    renaming: Mapping[str, str],
    normalized: bool,
    strict: bool,
    report: Callable[[float], None],
) -> Imported:
    """Write the pictures of archives and TFRecord files to a folder, except those that are there already.

    files: as `is_shard` tells them apart. renaming, normalized: for records, as `picture_of` takes them. report: is
    called with the share of the work that is done, 0 to 1. A record that lacks a feature or can't be decoded is
    skipped, and a picture that lacks a file is named; with `strict` they raise InputError. Always raises InputError for
    an unreadable or damaged file, lenses in the other unit, and two different pictures of one number.
    """
    for name in files:
        check_readable(name)
    convert = partial(picture_of, renaming=renaming, normalized=normalized)
    folder = PictureFolder(out)
    there, skipped, numbers = folder.count, list[str](), count()
    for position, name in enumerate(files):
        if is_shard(name):
            shares = import_shard(name, folder)
        else:
            shares = _import_records(Path(name), folder, numbers, convert, None if strict else skipped)
        for share in shares:
            report((position + share) / len(files))
    incomplete = folder.lacking(folder.imported)
    if incomplete and strict:
        raise InputError(f"{out}: {incomplete[0]}; {len(incomplete)} pictures lack a file")
    return Imported(folder.count - there, there, (*skipped, *incomplete), tuple(folder.remarks))


def _import_records(
    path: Path,
    folder: PictureFolder,
    numbers: Iterator[int],
    convert: Callable[[Any, int], dict[FileName, bytes]],
    skipped: list[str] | None,
) -> Iterator[float]:
    """Write the pictures of a TFRecord file. skipped: gets the faults of records; None: raise them."""
    for record in read_records(path):
        number = next(numbers)
        try:
            found = convert(parse_example(record.payload), number)
        except VisualMeshError as error:
            fault = f"{record.where}: {error}"
            if skipped is None or isinstance(error, WrongUnitError):
                raise InputError(fault) from error
            skipped.append(fault)
        else:
            for name, content in found.items():
                folder.write(name, content)
        yield record.share


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
