"""Pictures of tar shards in the order in which their bytes come, from files, pipes or the network."""

from __future__ import annotations

import gzip
import io
import subprocess
import sys
import tarfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from http.client import HTTPException
from itertools import groupby
from pathlib import Path
from typing import IO
from urllib.request import urlopen

import numpy as np

from vm_embedded.errors import InputError, one_line

from .picture_files import PARTS, PictureFault, RawPicture
from .shard_index import key_and_part

_BUFFER = 256
"""Pictures that wait for their turn: about 50 MB of JPEG and PNG files of 640 x 512 px."""

_PATIENCE = 60.0  # for a server's next bytes [s]
_PATIENCE_AT_END = 5.0  # for a command to end after its last byte [s]


def stream(
    shards: Iterable[str | Path],
    seed: tuple[int, ...] | None = None,
    buffer: int = _BUFFER,
    report: Callable[[PictureFault], None] | None = None,
) -> Iterator[RawPicture]:
    """All pictures of shards, one shard after the other: names of files, "-" for standard input, "pipe:" and a command
    of the shell, or http and https addresses. A shard may be gzipped.

    With a seed they come shuffled: each is drawn from the next `buffer` that are there. A picture that lacks a part is
    reported and left out, or raised. Raises InputError naming the shard, and the picture and byte after which it is
    damaged or cut short.
    """
    pictures = (picture for shard in shards for picture in _pictures(str(shard), report or _raise))
    return pictures if seed is None else _shuffled(pictures, seed, buffer)


def _raise(fault: PictureFault) -> None:
    raise fault


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


def _pictures(shard: str, report: Callable[[PictureFault], None]) -> Iterator[RawPicture]:
    after, source = "its begin", _Counted(io.BytesIO())
    try:
        with _opened(shard) as opened:
            source = _Counted(opened)
            for number, files in groupby(_files(source), lambda each: each[0]):
                parts = [(part, content) for _, part, content in files]
                try:
                    picture = _picture(shard, number, parts)
                except PictureFault as fault:
                    report(fault)
                else:
                    yield picture
                after = f"picture {number}"
    except (tarfile.TarError, OSError, EOFError, zlib.error, HTTPException) as error:
        place = f"after {after}, at byte {source.count}"
        raise InputError(f"{shard}: can't be read on {place}: {one_line(error)}") from error


def _picture(shard: str, number: str, parts: Sequence[tuple[str, bytes]]) -> RawPicture:
    """A picture of parts with their names. Raises PictureFault if it has not one of each."""
    found = dict(parts)
    missing = [part for part in PARTS if part not in found]
    if missing:
        lacks = f"lacks its {' and '.join(missing)}, or its files are not in a row"
        raise PictureFault(f"{shard}: picture {number} {lacks}", "missing")
    if len(parts) > len(found):
        raise PictureFault(f"{shard} has two files for one part of picture {number}")
    try:
        return RawPicture(number, found["image"], found["mask"], found["lens"].decode("utf-8"))
    except UnicodeDecodeError as error:
        raise PictureFault(f"{shard}: the lens file of picture {number} is no text", "lens") from error


def _files(source: _Counted) -> Iterator[tuple[str, str, bytes]]:
    """Number, part and content of a tar's files."""
    with tarfile.open(fileobj=source, mode="r|") as tar:
        for member in tar:
            number, part = key_and_part(member.name)
            content = tar.extractfile(member) if member.isfile() and part is not None else None
            if content is not None and part is not None:
                yield number, part, content.read()
    # tarfile takes the end of a cut stream for that of the archive, whose last 512 bytes are 0.
    while source.read(1 << 16):
        pass
    if source.last != bytes(512):
        raise tarfile.ReadError("it is cut short or damaged")


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
