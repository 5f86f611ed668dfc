"""The pictures in tar archives, plain or gzip: from a file, a web server or standard input.

A member has the name of a file in a folder of pictures, as image7.jpg, or webdataset's, with the picture's number
first: 7.jpg, 7.mask.png, 7.lens.yaml. Memory does not grow with what headers claim.
"""

from __future__ import annotations

import gzip
import io
import os
import sys
import tarfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.client import HTTPException
from pathlib import Path, PurePosixPath
from typing import IO
from urllib.request import urlopen

from vm_embedded.borders.credentials import without_credentials
from vm_embedded.errors import InputError, one_line
from vm_embedded.files import open_regular, read_pieces

from ..data.picture_files import IMAGES, LARGEST_FILE, FileName, parse_name
from .picture_folder import PictureFolder

_ADDRESSES = ("http://", "https://")
_TIMEOUT = 60.0  # for the next bytes of a server [s]

_LARGEST_HEADERS = 20 * 2**10
"""Most bytes of the headers of one member: long names take a few hundred. The time of tarfile grows with the square."""

_MOST_ENDS = 8  # reads that give nothing

_DAMAGE = (tarfile.TarError, OSError, EOFError, ValueError, OverflowError, RecursionError, zlib.error, HTTPException)
"""What reading a damaged archive raises."""

_PARTS = {**dict.fromkeys(IMAGES, "image"), ".mask.png": "mask", ".lens.yaml": "lens", ".scene.json": "scene"}
"""Parts of a picture by the suffixes of webdataset."""


def is_shard(name: str) -> bool:
    """Whether an input is an archive and not a TFRecord file: standard input "-", a web address, or by its suffix."""
    return name == "-" or name.startswith(_ADDRESSES) or name.lower().endswith((".tar", ".tar.gz", ".tgz"))


def check_readable(name: str) -> None:
    """Check an input before long work. Raises InputError if it is a file that can't be opened."""
    if name != "-" and not name.startswith(_ADDRESSES):
        try:
            open_regular(Path(name)).close()
        except OSError as error:
            raise InputError(f"can't read {name}: {error.strerror or error}") from error


def import_shard(name: str, folder: PictureFolder) -> Iterator[float]:
    """Write the pictures of an archive to a folder. Gives the share that was read, 0 to 1, after each member.

    An archive that the folder holds as a whole already is not read again. Raises InputError if a file can't be written,
    and if the archive can't be read or is damaged, naming the last good member and the byte.
    """
    shown, after, source = without_credentials(name), "its start", TarSource(io.BytesIO())
    numbers, others, other = set[str](), 0, ""
    try:
        with _opened(name) as (file, stamp, share):
            if not folder.holds(shown, stamp):
                source = TarSource(_unzipped(file))
                for member, found, content in _members(source):
                    if found is None:
                        others, other = others + 1, member
                    else:
                        folder.write(found, content)
                        numbers.add(found.number)
                    after = member
                    yield share()
                if not folder.lacking(numbers):
                    folder.finish(shown, stamp)
    except _DAMAGE as error:
        raise InputError(f"{shown}: can't be read after {after}, at byte {source.count}: {one_line(error)}") from error
    if others:
        folder.remarks.append(f"{shown}: left out {others} other files, for example {other}")
    yield 1.0


class TarSource(io.RawIOBase):
    """The bytes of an archive, for tarfile. It counts them and keeps the last 512 of them.

    Before the first member, and between two members, only so many bytes can be read as headers may have: tarfile itself
    reads as much as a header claims. It also goes on reading after the end, until a size is reached.
    """

    def __init__(self, source: IO[bytes]) -> None:
        self._source, self.count, self.last, self._ends = source, 0, b"", 0
        self.limit: int | None = _LARGEST_HEADERS

    def read(self, size: int = -1) -> bytes:
        """The next bytes. Raises ReadError beyond the limit, and EOFError if there were none again and again."""
        if self.limit is not None and not 0 <= size <= self.limit - self.count:
            raise tarfile.ReadError(f"the headers of a member have more than {_LARGEST_HEADERS} bytes")
        data = self._source.read(size)
        self._ends = 0 if data else self._ends + 1
        if self._ends > _MOST_ENDS:
            raise EOFError("it is cut short")
        self.count += len(data)
        self.last = (self.last + data)[-512:] if len(data) < 512 else data[-512:]
        return data


def _members(source: TarSource) -> Iterator[tuple[str, FileName | None, bytes]]:
    """Name and content of all members but folders; for another file than one of a picture: None, and no content."""
    place = -1
    with tarfile.open(fileobj=source, mode="r|") as tar:
        while (member := tar.next()) is not None:
            if member.size < 0 or tar.offset <= place:
                raise tarfile.ReadError(f"the size of {member.name} leads back to an earlier member")
            place, source.limit = tar.offset, None
            tar.members.clear()  # type: ignore[attr-defined]  # an archive may have millions
            found = file_name(member.name) if member.isfile() else None
            if not member.isdir():
                yield member.name, found, b"" if found is None else _content(tar, member)
            source.limit = place + _LARGEST_HEADERS
        source.limit = None
    # tarfile accepts a cut stream as a complete archive; the last 512 bytes of a complete one are 0.
    while source.read(1 << 16):
        pass
    if source.last != bytes(512):
        raise tarfile.ReadError("it is cut short or damaged")


def file_name(member: str) -> FileName | None:
    """The file of a picture that a member's name stands for; None for another file.

    Raises ReadError for a name that leads out of the folder.
    """
    path = PurePosixPath(member)
    if path.is_absolute() or ".." in path.parts:
        raise tarfile.ReadError(f"the name {member} leads out of the folder")
    stem, dot, rest = path.name.partition(".")
    suffix = (dot + rest).lower()
    found = parse_name(stem + suffix) if suffix.count(".") == 1 else None
    if found is not None or not stem or suffix not in _PARTS:
        return found
    # The keys of webdataset may begin with "image", too: the mask of image7.jpg is image7.mask.png then.
    return FileName(_PARTS[suffix], stem.removeprefix("image"), "." + suffix.rpartition(".")[2])


def _content(tar: tarfile.TarFile, member: tarfile.TarInfo) -> bytes:
    """The content of a file. Raises ReadError if it is too large, or sparse: then a few bytes may stand for many."""
    if member.issparse():
        raise tarfile.ReadError(f"{member.name} is a sparse file; write the archive without them")
    if member.size > LARGEST_FILE:
        raise tarfile.ReadError(f"{member.name} has {member.size} bytes; at most {LARGEST_FILE} are allowed")
    content = tar.extractfile(member)
    assert content is not None  # only a folder and the like has none
    return read_pieces(content, LARGEST_FILE)


@contextmanager
def _opened(name: str) -> Iterator[tuple[IO[bytes], str | None, Callable[[], float]]]:
    """The bytes of an archive, a stamp that changes with it, if there is one, and the share that was read."""
    if name == "-":
        yield sys.stdin.buffer, None, lambda: 0.0
    elif name.startswith(_ADDRESSES):
        with urlopen(name, timeout=_TIMEOUT) as answer:
            size, version = answer.length, answer.headers["ETag"] or answer.headers["Last-Modified"]
            stamp = f"{size} {version}" if size and version else None
            yield io.BufferedReader(answer), stamp, lambda: 1.0 - (answer.length or 0) / size if size else 0.0
    else:
        with open_regular(Path(name)) as file:
            facts = os.fstat(file.fileno())
            yield file, f"{facts.st_size} {facts.st_mtime_ns}", lambda: file.tell() / max(facts.st_size, 1)


def _unzipped(file: IO[bytes]) -> IO[bytes]:
    assert isinstance(file, io.BufferedReader)
    return gzip.open(file) if file.peek(2)[:2] == b"\x1f\x8b" else file  # type: ignore[return-value]
