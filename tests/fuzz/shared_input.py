"""The input that a fuzzed process is working on, in a file that both it and the process that watches it map."""

import mmap
import struct
from pathlib import Path

MOST_BYTES = 2**20
"""Longest input [bytes]."""

_HEAD = struct.Struct("<QQQ")  # inputs so far, length of this one, memory before the first one [bytes]


class SharedInput:
    """count: number of inputs so far. input: the one in progress. memory: the process's peak before the first mutated
    input [bytes], 0 until then."""

    def __init__(self, path: Path) -> None:
        with path.open("a+b") as file:
            file.truncate(_HEAD.size + MOST_BYTES)
            self._map = mmap.mmap(file.fileno(), _HEAD.size + MOST_BYTES)

    def begin(self, data: bytes) -> None:
        """Note that work on an input begins."""
        count, _, memory = _HEAD.unpack_from(self._map)
        self._map[_HEAD.size : _HEAD.size + len(data)] = data
        _HEAD.pack_into(self._map, 0, count + 1, len(data), memory)

    @property
    def count(self) -> int:
        return int(_HEAD.unpack_from(self._map)[0])

    @property
    def input(self) -> bytes:
        return self._map[_HEAD.size : _HEAD.size + _HEAD.unpack_from(self._map)[1]]

    @property
    def memory(self) -> int:
        return int(_HEAD.unpack_from(self._map)[2])

    @memory.setter
    def memory(self, value: int) -> None:
        count, length, _ = _HEAD.unpack_from(self._map)
        _HEAD.pack_into(self._map, 0, count, length, value)
