"""TFRecord files and the Examples in them, read and written without TensorFlow or protobuf.

A record is the length of its payload (uint64), the length's checksum (uint32), the payload, and the payload's checksum
(uint32), all little-endian; checksums are masked CRC-32C. An Example is a protobuf message that maps names to lists of
bytes, floats or whole numbers. Records are counted from 0.
"""

from __future__ import annotations

import gzip
import io
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vm_embedded.errors import InputError, one_line
from vm_embedded.files import written_beside

_LARGEST = 2**31 - 1  # bytes of a protobuf message
_PIECE = 2**24  # bytes; read at a time, so that a wrong length does not ask for memory that the file can't fill
_HEADER = 12  # bytes

_Registers = npt.NDArray[np.uint32]


@dataclass(frozen=True)
class BytesList:
    """Values of a feature that is bytes."""

    values: tuple[bytes, ...]


@dataclass(frozen=True)
class FloatList:
    """Values of a feature that is float; the file keeps 32 bits of each."""

    values: tuple[float, ...]


@dataclass(frozen=True)
class Int64List:
    """Values of a feature that is int64."""

    values: tuple[int, ...]


Feature = BytesList | FloatList | Int64List
Example = Mapping[str, Feature]


@dataclass(frozen=True)
class Record:
    """One record of a file.

    checksum: of the payload, masked, as the file has it. position: how far the file is read [bytes on disk].
    """

    path: Path
    number: int
    payload: bytes
    checksum: int
    position: int

    @property
    def where(self) -> str:
        """File and number, for messages."""
        return f"{self.path}: record {self.number}"

    def check(self) -> None:
        """Raise InputError if the payload does not fit its checksum."""
        if masked_crc32c(self.payload) != self.checksum:
            raise InputError(f"{self.where} is damaged: the checksum of its content is wrong")

    def example(self, checked: bool = True) -> Example:
        """The Example in the payload, after `check` unless told otherwise. Raises InputError naming file and record.

        The check takes some 3 ms a megabyte, far less than decoding its pictures.
        """
        if checked:
            self.check()
        try:
            return parse_example(self.payload)
        except InputError as error:
            raise InputError(f"{self.where}: {error}") from error


def read_records(path: Path) -> Iterator[Record]:
    """The records of a TFRecord file, plain or gzip, one in memory at a time.

    Checksums of lengths are checked always, those of payloads by `Record.check` and `Record.example`: what follows a
    damaged payload can still be read, what follows a damaged length can't. An empty file has no records. Raises
    InputError naming file, record and fault.
    """
    number = 0
    try:
        with path.open("rb") as file:
            stream: io.BufferedIOBase = gzip.GzipFile(fileobj=file) if _is_gzip(file) else file
            while header := _read(stream, _HEADER):
                length = _length(path, number, header)
                payload = _read(stream, length)
                end = _read(stream, 4)
                if len(end) < 4:
                    raise _truncated(path, number)
                yield Record(path, number, payload, int.from_bytes(end, "little"), file.tell())
                number += 1
    except EOFError as error:  # gzip's, of a file that breaks off
        raise _truncated(path, number) from error
    except (zlib.error, gzip.BadGzipFile) as error:
        raise InputError(f"{path}: record {number}: the gzip file is damaged: {one_line(error)}") from error
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise InputError(f"can't read {path}: {getattr(error, 'strerror', None) or error}") from error


def write_records(path: Path, payloads: Iterable[bytes], compressed: bool = False) -> None:
    """Write a TFRecord file, plain or gzip, that takes its place once it is whole. Raises InputError if it can't."""
    with written_beside(path) as part, part.open("wb") as file:
        # Without time and name, so that the same records make the same file. Pictures are compressed already.
        packed = gzip.GzipFile("", "wb", compresslevel=1, fileobj=file, mtime=0) if compressed else nullcontext(file)
        with packed as stream:
            for payload in payloads:
                length = struct.pack("<Q", len(payload))
                stream.write(length + struct.pack("<I", masked_crc32c(length)))
                stream.write(payload)
                stream.write(struct.pack("<I", masked_crc32c(payload)))


def _is_gzip(file: io.BufferedReader) -> bool:
    head = file.read(_HEADER)
    file.seek(0)
    # A plain record of 559,903 bytes begins as gzip does, so a length that fits its checksum goes first.
    return head.startswith(b"\x1f\x8b") and not _fits(head)


def _fits(header: bytes) -> bool:
    return len(header) == _HEADER and masked_crc32c(header[:8]) == int.from_bytes(header[8:], "little")


def _length(path: Path, number: int, header: bytes) -> int:
    """Length [bytes] that a record's header tells. Raises InputError."""
    if number == 0 and not _fits(header):
        raise InputError(f"{path} is not a TFRecord file, or damaged from its first bytes on")
    if len(header) < _HEADER:
        raise _truncated(path, number)
    if not _fits(header):
        raise InputError(f"{path}: record {number} is damaged: the checksum of its length is wrong")
    length = int.from_bytes(header[:8], "little")
    if length > _LARGEST:
        raise InputError(f"{path}: record {number} has {length} bytes, more than an Example can have")
    return length


def _truncated(path: Path, number: int) -> InputError:
    return InputError(f"{path} is truncated: it breaks off in record {number}")


def _read(stream: io.BufferedIOBase, count: int) -> bytes:
    """The next `count` bytes, or fewer where the file ends."""
    if count <= _PIECE:
        return stream.read(count)
    pieces = []
    while count and (piece := stream.read(min(count, _PIECE))):
        pieces.append(piece)
        count -= len(piece)
    return b"".join(pieces)


# Checksums.


def masked_crc32c(data: bytes) -> int:
    """The CRC-32C as TFRecord files have it: rotated by 15 bits, plus a constant."""
    crc = crc32c(data)
    return ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF


def crc32c(data: bytes) -> int:
    """CRC-32C (Castagnoli).

    The register is linear over GF(2), so the two halves of a text can be taken apart: that of the first, moved on by
    as many zero bytes as the second has, plus (xor) that of the second. Long data are folded so in pairs, all pairs
    of a level at once.
    """
    if len(data) < 256:
        table, register = _byte_list(), 0xFFFFFFFF
        for byte in data:
            register = table[(register ^ byte) & 255] ^ register >> 8
        return register ^ 0xFFFFFFFF
    start = -len(data) % 4  # zeros in front change nothing while the register is zero
    text = np.zeros(start + len(data), dtype=np.uint8)
    text[start:] = np.frombuffer(data, dtype=np.uint8)
    text[start : start + 4] ^= 255  # stands for the register's first value
    words = text.view(np.uint32)
    level = 0
    while len(words) > 1:
        if len(words) % 2:
            words = np.concatenate([np.zeros(1, dtype=np.uint32), words])
        words = _moved_on(words[0::2], level) ^ words[1::2]
        level += 1
    return int(_moved_on(words, 0)[0]) ^ 0xFFFFFFFF


def _moved_on(registers: _Registers, level: int) -> _Registers:
    """Registers (n,) after 4 * 2^level zero bytes."""
    parts = np.ascontiguousarray(registers).view(np.uint8).reshape(-1, 4)
    moved = np.zeros(len(parts), dtype=np.uint32)
    for table, part in zip(_tables(level), parts.T, strict=True):
        moved ^= table.take(part)
    return moved


@cache
def _tables(level: int) -> _Registers:
    """What each byte of a register (4, 256) becomes after 4 * 2^level zero bytes."""
    if level > 0:
        return _moved_on(_tables(level - 1).ravel(), level - 1).reshape(4, 256)
    registers = np.arange(256, dtype=np.uint32) << np.array([[0], [8], [16], [24]], dtype=np.uint32)
    for _ in range(4):
        registers = _byte_table()[registers & 255] ^ registers >> 8
    return registers


@cache
def _byte_table() -> _Registers:
    """What each value (256,) of a register's lowest byte becomes after one zero byte."""
    registers = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        registers = np.where(registers & 1, registers >> 1 ^ 0x82F63B78, registers >> 1).astype(np.uint32)
    return registers


@cache
def _byte_list() -> list[int]:
    return [int(each) for each in _byte_table()]


# Examples.

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
"""Wire types of protobuf."""


def parse_example(payload: bytes) -> Example:
    """The features of an Example by name; those that have no list are left out.

    As protobuf has it, lists of numbers may be packed or not, fields that are not known are passed over, and a message
    in parts is the sum of its parts. Raises InputError if the payload is no Example.
    """
    example: dict[str, Feature] = {}
    for entry in _inner(_joined(_inner(memoryview(payload), 1)), 1):
        name = _text(_joined(_inner(entry, 1)[-1:]))
        try:
            feature = _feature(_joined(_inner(entry, 2)))
        except InputError as error:
            raise InputError(f"{name!r}: {error}") from error
        if feature is not None:
            example[name] = feature
    return example


def _feature(message: memoryview) -> Feature | None:
    lists = [_inner(message, number) for number in (1, 2, 3)]
    if sum(bool(each) for each in lists) > 1:
        raise _no_example("a feature has lists of several kinds")
    texts, floats, integers = (_joined(each) for each in lists)
    if lists[0]:
        return BytesList(tuple(bytes(each) for each in _inner(texts, 1)))
    if lists[1]:
        return FloatList(_floats(floats))
    if lists[2]:
        return Int64List(_integers(integers))
    return None


def _floats(message: memoryview) -> tuple[float, ...]:
    parts = []
    for number, wire, value in _fields(message):
        if number == 1:
            if not isinstance(value, memoryview) or wire == _FIXED64 or len(value) % 4:
                raise _no_example("a list of floats holds something else")
            parts.append(value)
    return tuple(np.frombuffer(b"".join(parts), dtype="<f4").tolist())


def _integers(message: memoryview) -> tuple[int, ...]:
    values: list[int] = []
    for number, wire, value in _fields(message):
        if number != 1:
            continue
        if isinstance(value, int):
            values.append(value)
        elif wire == _BYTES:
            at = 0
            while at < len(value):
                each, at = _varint(value, at)
                values.append(each)
        else:
            raise _no_example("a list of whole numbers holds something else")
    return tuple(each - 2**64 if each >= 2**63 else each for each in values)


def _inner(message: memoryview, wanted: int) -> list[memoryview]:
    """All values of a field that is bytes, text or a message."""
    found = []
    for number, wire, value in _fields(message):
        if number == wanted:
            if wire != _BYTES or isinstance(value, int):
                raise _no_example(f"field {number} has wire type {wire}")
            found.append(value)
    return found


def _joined(parts: list[memoryview]) -> memoryview:
    """A message from its parts: protobuf's sum of messages is their bytes one after the other."""
    return parts[0] if len(parts) == 1 else memoryview(b"".join(parts))


def _text(value: memoryview) -> str:
    try:
        return str(value, "utf-8")
    except UnicodeDecodeError as error:
        raise _no_example("the name of a feature is not text") from error


def _fields(message: memoryview) -> Iterator[tuple[int, int, int | memoryview]]:
    """Number, wire type and value of each field: a number if the wire type is _VARINT, else its bytes."""
    at = 0
    while at < len(message):
        tag, at = _varint(message, at)
        number, wire = tag >> 3, tag & 7
        if not 1 <= number < 2**29:
            raise _no_example(f"there is no field {number}")
        if wire == _VARINT:
            value, at = _varint(message, at)
            yield number, wire, value
            continue
        if wire == _BYTES:
            size, at = _varint(message, at)
        elif wire in (_FIXED32, _FIXED64):
            size = 4 if wire == _FIXED32 else 8
        else:
            raise _no_example(f"wire type {wire} is not used")
        if size > len(message) - at:
            raise _no_example("it breaks off")
        yield number, wire, message[at : at + size]
        at += size


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """The number below 2^64 that begins at `at`, and where the next thing begins."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(message):
            raise _no_example("it breaks off")
        byte = message[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            break
    else:
        raise _no_example("a number is too long")
    if value >= 2**64:
        raise _no_example("a number is too large")
    return value, at


def _no_example(what: str) -> InputError:
    return InputError(f"not an Example: {what}")


def example_bytes(example: Example) -> bytes:
    """The payload of an Example, as protobuf writes it, with the features in the order of the mapping.

    Raises OverflowError for a number that the list can't hold.
    """
    entries = (
        _field(1, _field(1, name.encode()) + _field(2, _feature_bytes(feature))) for name, feature in example.items()
    )
    return _field(1, b"".join(entries))


def _feature_bytes(feature: Feature) -> bytes:
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


def _field(number: int, value: bytes) -> bytes:
    return _varint_bytes(number << 3 | _BYTES) + _varint_bytes(len(value)) + value


def _varint_bytes(value: int) -> bytes:
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    return bytes(out)
