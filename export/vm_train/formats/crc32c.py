"""CRC-32C (Castagnoli), the checksum of TFRecord files, in numpy and fast enough for pictures."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

_Registers = npt.NDArray[np.uint32]


def masked_crc32c(data: bytes) -> int:
    """The checksum in TFRecord files: the CRC-32C rotated by 15 bits, plus a constant."""
    crc = crc32c(data)
    return ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF


def crc32c(data: bytes) -> int:
    """CRC-32C (Castagnoli).

    The register is linear over GF(2). So the register of a text is that of its first half, moved on by as many zero
    bytes as the second half has, plus (xor) that of the second half. Long data are folded in pairs this way, all pairs
    of a level at once.
    """
    if len(data) < 256:
        table, register = _byte_list(), 0xFFFFFFFF
        for byte in data:
            register = table[(register ^ byte) & 255] ^ register >> 8
        return register ^ 0xFFFFFFFF
    start = -len(data) % 4  # leading zeros do not change a register of zero
    text = np.zeros(start + len(data), dtype=np.uint8)
    text[start:] = np.frombuffer(data, dtype=np.uint8)
    text[start : start + 4] ^= 255  # has the effect of the initial register
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
    """Registers (4, 256) after 4 * 2^level zero bytes, from each value of each byte of a register."""
    if level > 0:
        return _moved_on(_tables(level - 1).ravel(), level - 1).reshape(4, 256)
    registers = np.arange(256, dtype=np.uint32) << np.array([[0], [8], [16], [24]], dtype=np.uint32)
    for _ in range(4):
        registers = _byte_table()[registers & 255] ^ registers >> 8
    return registers


@cache
def _byte_table() -> _Registers:
    """Registers (256,) after one zero byte, from each value of a register's lowest byte."""
    registers = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        registers = np.where(registers & 1, registers >> 1 ^ 0x82F63B78, registers >> 1).astype(np.uint32)
    return registers


@cache
def _byte_list() -> list[int]:
    return [int(each) for each in _byte_table()]
