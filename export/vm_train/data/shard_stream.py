"""A stream of the pictures in tar shards, from files, pipes or the network."""

from __future__ import annotations

import gzip
import io
import subprocess
import sys
import tarfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPException
from itertools import groupby
from pathlib import Path
from typing import IO
from urllib.request import urlopen

import numpy as np

from vm_embedded.errors import InputError, one_line
from vm_embedded.files import open_regular, read_pieces

from .picture_files import LARGEST_FILE, PARTS, PictureFault, RawPicture
from .shard_index import key_and_part
from .tar_members import DAMAGE, TarSource, check_readable, members

_BUFFER = 256
"""Pictures to shuffle at a time: about 50 MB of JPEG and PNG files of 640 x 512 px."""

_BUFFER_BYTES = 2**30
"""Bytes of pictures to shuffle at a time: 256 of 12 Mpx have fewer."""

_TIMEOUT = 60.0  # for the next bytes of a server [s]
_TIMEOUT_AT_END = 5.0  # for a command to end after its last byte [s]


def stream(
    shards: Iterable[str | Path],
    seed: tuple[int, ...] | None = None,
    buffer: int = _BUFFER,
    report: Callable[[PictureFault], None] | None = None,
) -> Iterator[RawPicture]:
    """All pictures of some shards, one shard after the other.

    shards: file names, "-" for standard input, "pipe:" followed by a shell command, or http and https addresses; each
    may be gzipped. seed: shuffles the pictures; each is drawn from a buffer with the next `buffer` pictures. report:
    gets the fault of each picture that lacks a part, which is then skipped; without `report` the fault is raised.
    Raises InputError for a shard that is damaged or cut short, naming the last good picture and the byte.
    """
    pictures = (picture for shard in shards for picture in _pictures(str(shard), report or _raise))
    return pictures if seed is None else _shuffled(pictures, seed, buffer)


def _raise(fault: PictureFault) -> None:
    raise fault


def _shuffled(pictures: Iterator[RawPicture], seed: tuple[int, ...], buffer: int) -> Iterator[RawPicture]:
    random = np.random.default_rng(seed)
    waiting: list[RawPicture] = []
    size = 0
    for picture in pictures:
        waiting.append(picture)
        size += _size(picture)
        while len(waiting) >= buffer or size > _BUFFER_BYTES:
            drawn = _drawn(waiting, random)
            size -= _size(drawn)
            yield drawn
    while waiting:
        yield _drawn(waiting, random)


def _size(picture: RawPicture) -> int:
    return len(picture.image) + len(picture.mask) + len(picture.lens)


def _drawn(waiting: list[RawPicture], random: np.random.Generator) -> RawPicture:
    position = int(random.integers(len(waiting)))
    waiting[position], waiting[-1] = waiting[-1], waiting[position]
    return waiting.pop()


def _pictures(shard: str, report: Callable[[PictureFault], None]) -> Iterator[RawPicture]:
    after, source = "its start", TarSource(io.BytesIO())
    try:
        with _opened(shard) as opened:
            source = TarSource(opened)
            for number, files in groupby(_files(source), lambda each: each[0]):
                try:
                    picture = _picture(shard, number, ((part, content) for _, part, content in files))
                except PictureFault as fault:
                    report(fault)
                else:
                    yield picture
                after = f"picture {number}"
    except (*DAMAGE, zlib.error, HTTPException) as error:
        place = f"after {after}, at byte {source.count}"
        raise InputError(f"{shard}: can't be read {place}: {one_line(error)}") from error


def _picture(shard: str, number: str, parts: Iterable[tuple[str, bytes]]) -> RawPicture:
    """A picture from its named parts. Raises PictureFault unless there is exactly one of each."""
    found: dict[str, bytes] = {}
    for part, content in parts:
        if part in found:
            raise PictureFault(f"{shard} has two files for one part of picture {number}")
        found[part] = content
    missing = [part for part in PARTS if part not in found]
    if missing:
        lacks = f"lacks its {' and '.join(missing)}, or its files are not next to each other"
        raise PictureFault(f"{shard}: picture {number} {lacks}", "missing")
    try:
        return RawPicture(number, found["image"], found["mask"], found["lens"].decode("utf-8"))
    except UnicodeDecodeError as error:
        raise PictureFault(f"{shard}: the lens file of picture {number} is not UTF-8 text", "lens") from error


def _files(source: TarSource) -> Iterator[tuple[str, str, bytes]]:
    """Number, part and content of the files of a tar archive."""
    with tarfile.open(fileobj=source, mode="r|") as tar:
        for member in members(tar, source):
            number, part = key_and_part(member.name)
            if member.isfile() and part is not None:
                check_readable(member)
                content = tar.extractfile(member)
                assert content is not None  # only a folder and the like has none
                yield number, part, read_pieces(content, LARGEST_FILE)
    # tarfile accepts a cut stream as a complete archive; the last 512 bytes of a complete one are 0.
    while source.read(1 << 16):
        pass
    if source.last != bytes(512):
        raise tarfile.ReadError("it is cut short or damaged")


@contextmanager
def _opened(shard: str) -> Iterator[IO[bytes]]:
    """The unzipped bytes of a shard. Raises OSError, also if a command failed."""
    if shard.startswith("pipe:"):
        with subprocess.Popen(shard.removeprefix("pipe:"), shell=True, stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            try:
                yield _unzipped(process.stdout)
            except (*DAMAGE, zlib.error):  # a command that fails writes no valid archive
                _end(process)
                raise
            else:
                _end(process)
            finally:
                process.kill()  # also if the reader stops early
    elif shard.startswith(("http://", "https://")):
        with urlopen(shard, timeout=_TIMEOUT) as answer:
            yield _unzipped(io.BufferedReader(answer))
    elif shard == "-":
        yield _unzipped(sys.stdin.buffer)
    else:
        with open_regular(Path(shard)) as file:
            yield _unzipped(file)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Raise OSError if a command failed. A command that is still running has not failed."""
    with suppress(subprocess.TimeoutExpired):
        if process.wait(_TIMEOUT_AT_END):
            raise OSError(f"its command ended with status {process.returncode}")


def _unzipped(source: IO[bytes]) -> IO[bytes]:
    assert isinstance(source, io.BufferedReader)
    return gzip.open(source) if source.peek(2)[:2] == b"\x1f\x8b" else source  # type: ignore[return-value]
