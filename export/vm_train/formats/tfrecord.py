"""TFRecord files, read without TensorFlow.

A record is the length of its payload (uint64), the length's checksum (uint32), the payload, and the payload's checksum
(uint32), all little-endian; checksums are masked CRC-32C. Records are counted from 0.
"""

from __future__ import annotations

import gzip
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, BinaryIO

import google_crc32c

from vm_embedded.errors import InputError, one_line
from vm_embedded.files import open_regular, read_up_to

_LARGEST = 2**26
"""Most bytes of a record, with an image and a mask: protobuf may need 15 times as much memory."""

_HEADER = 12  # bytes


@dataclass(frozen=True)
class Record:
    """One record of a file.

    where: file and number, for messages. checksum: of the payload, masked, from the file. share: of the file that is
    read so far, 0 to 1.
    """

    where: str
    content: bytes
    checksum: int
    share: float

    @property
    def payload(self) -> bytes:
        """The checked content. Raises InputError if it does not match its checksum."""
        if masked_crc32c(self.content) != self.checksum:
            raise InputError("it is damaged: the checksum of its content is wrong")
        return self.content


def read_records(path: Path) -> Iterator[Record]:
    """The records of a TFRecord file, plain or gzip, one in memory at a time.

    The checksums of lengths are always checked, those of payloads when they are taken. So records after a damaged
    payload can be read, but not after a damaged length. An empty file has no records. Raises InputError naming file,
    record and fault.
    """
    number = 0
    try:
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
            stream: IO[bytes] = gzip.GzipFile(fileobj=file) if _is_gzip(file) else file  # type: ignore[assignment]
            while header := read_up_to(stream, _HEADER):
                length = _length(path, number, header)
                payload = read_up_to(stream, length)
                end = read_up_to(stream, 4)
                if len(end) < 4:
                    raise _truncated(path, number)
                share = file.tell() / size
                yield Record(f"{path}: record {number}", payload, int.from_bytes(end, "little"), share)
                number += 1
    except EOFError as error:  # gzip raises it for a file that is cut short
        raise _truncated(path, number) from error
    except (zlib.error, gzip.BadGzipFile) as error:
        raise InputError(f"{path}: record {number}: the gzip file is damaged: {one_line(error)}") from error
    except OSError as error:
        raise InputError(f"can't read {path}: {error.strerror or error}") from error


def masked_crc32c(data: bytes) -> int:
    """The checksum in TFRecord files: the CRC-32C rotated by 15 bits, plus a constant."""
    crc: int = google_crc32c.value(data)
    return ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF


def _is_gzip(file: BinaryIO) -> bool:
    head = file.read(_HEADER)
    file.seek(0)
    # A plain record of 559,903 bytes starts like a gzip file, so a length with a correct checksum takes precedence.
    return head.startswith(b"\x1f\x8b") and not _fits(head)


def _fits(header: bytes) -> bool:
    return len(header) == _HEADER and masked_crc32c(header[:8]) == int.from_bytes(header[8:], "little")


def _length(path: Path, number: int, header: bytes) -> int:
    """Length of a payload [bytes], from the header of its record. Raises InputError."""
    if number == 0 and not _fits(header):
        raise InputError(f"{path} is not a TFRecord file, or its first bytes are damaged")
    if len(header) < _HEADER:
        raise _truncated(path, number)
    if not _fits(header):
        raise InputError(f"{path}: record {number} is damaged: the checksum of its length is wrong")
    length = int.from_bytes(header[:8], "little")
    if length > _LARGEST:
        raise InputError(f"{path}: record {number} has {length} bytes, more than the allowed {_LARGEST}")
    return length


def _truncated(path: Path, number: int) -> InputError:
    return InputError(f"{path} is cut short in record {number}")
