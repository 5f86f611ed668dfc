"""Pictures of tar shards in the order in which their bytes come, from files, pipes or the network."""

from __future__ import annotations

import gzip
import io
import subprocess
import sys
import tarfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPException
from pathlib import Path
from typing import IO
from urllib.request import urlopen

import numpy as np

from vm_embedded.errors import InputError, one_line

from .picture_files import PARTS, RawPicture
from .shard_index import key_and_part

_BUFFER = 256
"""Pictures that wait for their turn: about 50 MB of JPEG and PNG files of 640 x 512 px."""

_PATIENCE = 60.0  # for a server's next bytes [s]
_PATIENCE_AT_END = 5.0  # for a command to end after its last byte [s]


def stream(
    shards: Iterable[str | Path], seed: tuple[int, ...] | None = None, buffer: int = _BUFFER
) -> Iterator[RawPicture]:
    """All pictures of shards, one shard after the other: names of files, "-" for standard input, "pipe:" and a command
    of the shell, or http and https addresses. A shard may be gzipped.

    With a seed they come shuffled: each is drawn from the next `buffer` that are there. Raises InputError naming the
    shard, and the picture after which it is damaged or cut short.
    """
    pictures = (picture for shard in shards for picture in _pictures(str(shard)))
    return pictures if seed is None else _shuffled(pictures, seed, buffer)


def _shuffled(pictures: Iterator[RawPicture], seed: tuple[int, ...], buffer: int) -> Iterator[RawPicture]:
    random = np.random.default_rng(seed)
    waiting: list[RawPicture] = []
    for picture in pictures:
        waiting.append(picture)
        if len(waiting) >= buffer:
            yield _drawn(waiting, random)
    while waiting:
        yield _drawn(waiting, random)


def _drawn(waiting: list[RawPicture], random: np.random.Generator) -> RawPicture:
    position = int(random.integers(len(waiting)))
    waiting[position], waiting[-1] = waiting[-1], waiting[position]
    return waiting.pop()


def _pictures(shard: str) -> Iterator[RawPicture]:
    after = "its begin"
    number, parts = "", dict[str, bytes]()
    try:
        with _opened(shard) as source:
            for key, part, content in _files(source):
                if key != number:
                    if parts:
                        yield _picture(shard, number, parts)
                        after = f"picture {number}"
                    number, parts = key, {}
                if part in parts:
                    raise InputError(f"{shard} has two files for the {part} of picture {number}")
                parts[part] = content
        if parts:
            yield _picture(shard, number, parts)
    except (tarfile.TarError, OSError, EOFError, zlib.error, HTTPException, UnicodeDecodeError) as error:
        raise InputError(f"{shard}: can't be read on after {after}: {one_line(error)}") from error


def _picture(shard: str, number: str, parts: dict[str, bytes]) -> RawPicture:
    missing = [part for part in PARTS if part not in parts]
    if missing:
        raise InputError(f"{shard}: picture {number} lacks its {' and '.join(missing)}, or its files are not in a row")
    return RawPicture(number, parts["image"], parts["mask"], parts["lens"].decode("utf-8"))


def _files(source: IO[bytes]) -> Iterator[tuple[str, str, bytes]]:
    """Number, part and content of a tar's files."""
    counted = _Counted(source)
    with tarfile.open(fileobj=counted, mode="r|") as tar:
        for member in tar:
            number, part = key_and_part(member.name)
            content = tar.extractfile(member) if member.isfile() and part is not None else None
            if content is not None and part is not None:
                yield number, part, content.read()
    # tarfile takes the end of a cut stream for that of the archive, whose last 512 bytes are 0.
    while counted.read(1 << 16):
        pass
    if counted.last != bytes(512):
        raise tarfile.ReadError(f"it is cut short or damaged, at byte {counted.count}")


class _Counted(io.RawIOBase):
    """A stream that knows how many bytes came, and the last 512 of them."""

    def __init__(self, source: IO[bytes]) -> None:
        self._source, self.count, self.last = source, 0, b""

    def read(self, size: int = -1) -> bytes:
        data = self._source.read(size)
        self.count += len(data)
        self.last = (self.last + data)[-512:] if len(data) < 512 else data[-512:]
        return data


@contextmanager
def _opened(shard: str) -> Iterator[IO[bytes]]:
    """A shard's bytes, unzipped. Raises OSError, also where a command failed."""
    if shard.startswith("pipe:"):
        with subprocess.Popen(shard.removeprefix("pipe:"), shell=True, stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            try:
                yield _unzipped(process.stdout)
                _end(process)
            except tarfile.TarError:  # what a command writes that fails is no tar
                _end(process)
                raise
            finally:
                process.kill()  # also where the reader wants no more
    elif shard.startswith(("http://", "https://")):
        with urlopen(shard, timeout=_PATIENCE) as answer:
            yield _unzipped(io.BufferedReader(answer))
    elif shard == "-":
        yield _unzipped(sys.stdin.buffer)
    else:
        with Path(shard).open("rb") as file:
            yield _unzipped(file)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Raise OSError if a command failed; one that goes on for no reason is left alone."""
    with suppress(subprocess.TimeoutExpired):
        if process.wait(_PATIENCE_AT_END):
            raise OSError(f"its command ended with status {process.returncode}")


def _unzipped(source: IO[bytes]) -> IO[bytes]:
    assert isinstance(source, io.BufferedReader)
    return gzip.open(source) if source.peek(2)[:2] == b"\x1f\x8b" else source  # type: ignore[return-value]
