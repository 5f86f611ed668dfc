"""Bags whose recorder was killed: an MCAP file that ends anywhere, without index and footer, and no metadata.yaml."""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

from ...errors import InputError

_MAGIC = b"\x89MCAP0\r\n"

_HEADER, _FOOTER, _CHUNK, _DATA_END = 0x01, 0x02, 0x06, 0x0F
"""Kinds of records: the first, the last, one that holds others, and the one that ends the messages."""

_RECORD = struct.Struct("<BQ")
"""Kind and length of a record."""

_CHUNK_START = struct.Struct("<QQQIIQ")
"""First and last time of an uncompressed chunk, its length, checksum, the length 0 of a compression, and its length."""

_END = _RECORD.pack(_DATA_END, 4) + bytes(4) + _RECORD.pack(_FOOTER, 20) + bytes(20) + _MAGIC
"""The end of a file without an index."""


def is_finished(path: Path) -> bool:
    """Whether a file is no MCAP file, or one that its recorder finished. Raises OSError."""
    with path.open("rb") as file:
        start, size = file.read(len(_MAGIC)), file.seek(0, os.SEEK_END)
        file.seek(max(size - len(_MAGIC), 0))
        return path.suffix.lower() != ".mcap" or (start == file.read() == _MAGIC and size > len(_MAGIC))


class UnfinishedMcap:
    """The whole records of an unfinished MCAP file as a finished file; it has what rosbags needs of a path.

    Of a last chunk that is not whole, its whole records, unless it is compressed. lost: bytes behind them. Raises
    InputError if not even the first record is whole, and OSError.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.name, self.stem, self.suffix = path, path.name, path.stem, path.suffix
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(0)
            end = _end_of_records(file, len(_MAGIC), size) if file.read(len(_MAGIC)) == _MAGIC else 0
            if end <= len(_MAGIC):
                raise InputError(f"bag {path} has no whole record: its recorder was ended too early")
            self._pieces: list[bytes | range] = [range(end)]
            last = _last_chunk(file, end, size)
        if last is not None:
            self._pieces += last
            end = last[1].stop
        self._pieces.append(_END)
        self.lost = size - end

    def __str__(self) -> str:
        return str(self.path)

    def exists(self) -> bool:
        return True

    def is_dir(self) -> bool:
        return False

    def open(self, *_: Any, **__: Any) -> BinaryIO:
        """The file in binary mode."""
        return io.BufferedReader(_Joined(self.path, self._pieces))


def _end_of_records(file: BinaryIO, at: int, size: int) -> int:
    """Where the last whole record of messages ends, of those that begin at a place [bytes]."""
    while at + _RECORD.size <= size:
        file.seek(at)
        kind, length = _RECORD.unpack(file.read(_RECORD.size))
        end = at + _RECORD.size + length
        if not _HEADER <= kind < _DATA_END or kind == _FOOTER or end > size:
            break
        at = end
    return at


def _last_chunk(file: BinaryIO, at: int, size: int) -> tuple[bytes, range] | None:
    """A new start for the last, uncompressed chunk, which is not whole, and the place of its whole records; or None."""
    start = at + _RECORD.size + _CHUNK_START.size
    file.seek(at)
    content = file.read(start - at)
    if start > size or content[0] != _CHUNK:
        return None
    first, last, _, _, compression, _ = _CHUNK_START.unpack(content[_RECORD.size :])
    end = start if compression else _end_of_records(file, start, size)
    if end == start:
        return None
    length = end - start
    head = _RECORD.pack(_CHUNK, _CHUNK_START.size + length) + _CHUNK_START.pack(first, last, length, 0, 0, length)
    return head, range(start, end)


class _Joined(io.RawIOBase):
    """Pieces one after the other: places in a file, or bytes."""

    def __init__(self, path: Path, pieces: Sequence[bytes | range]) -> None:
        self._file = path.open("rb", buffering=0)
        self._pieces, self._at = pieces, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: sum(map(len, self._pieces))}[whence]
        self._at = max(start + offset, 0)
        return self._at

    def readinto(self, buffer: Any) -> int:
        at, content = self._at, b""
        for piece in self._pieces:
            if at < len(piece):
                part = piece[at:][: len(buffer)]
                if isinstance(part, range):
                    self._file.seek(part.start)
                    content = self._file.read(len(part)) or b""
                else:
                    content = part
                break
            at -= len(piece)
        buffer[: len(content)] = content
        self._at += len(content)
        return len(content)

    def close(self) -> None:
        self._file.close()
        super().close()
