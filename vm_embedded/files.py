"""Reading regular files, and writing files without losing the previous content or waiting for a pipe's reader."""

from __future__ import annotations

import errno
import os
import select
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, BinaryIO

from .errors import InputError

LARGEST = 2**30
"""Most bytes of a file that is read as a whole, unless its reader allows fewer."""

_PIECE = 2**20  # bytes to read at a time


def exists(path: Path) -> bool:
    """Whether a path exists. False for one that can't be looked at, where Path.exists raises OSError."""
    return os.path.exists(path)  # noqa: PTH110


def is_file(path: Path) -> bool:
    """Whether a path is a file. False for one that can't be looked at, where Path.is_file raises OSError."""
    return os.path.isfile(path)  # noqa: PTH113


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """A temporary path beside `path`, which replaces `path` when the block ends without an error.

    A symbolic link stays: its target is replaced. The file keeps its mode. A special file, such as a pipe, is written
    directly. Raises InputError if the file can't be written.
    """
    target = Path(os.path.realpath(path))
    part = target.with_name(target.name + ".part")
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            yield path  # not the target: that of /dev/stdout in a pipeline has no path
            return
        if target.is_file() and not os.access(target, os.W_OK):
            raise PermissionError(0, "the file is read-only")
        yield part
        if target.is_file():
            part.chmod(stat.S_IMODE(target.stat().st_mode))
        part.replace(target)
    except OSError as error:
        raise InputError(f"can't write {path}: {error.strerror or error}") from error
    finally:
        with suppress(OSError):  # on a disk that can't be written it was never created, or can't be removed
            part.unlink(missing_ok=True)


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading.

    Reading a pipe, socket or device may wait forever, or never end. Raises OSError for those, for a folder, for a name
    that can't be a path, and if the file can't be opened.
    """
    try:
        _check_regular(path, path.stat().st_mode)  # first of all, because some devices act when they are opened
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except ValueError as error:  # the name has a zero byte
        raise OSError(errno.EINVAL, str(error), str(path)) from error
    try:
        _check_regular(path, os.fstat(descriptor).st_mode)  # another file may have taken the name
    except OSError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def _check_regular(path: Path, mode: int) -> None:
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))


def read_pieces(stream: IO[bytes], largest: int) -> bytes:
    """The rest of a stream, in memory only as far as it exists. Raises OSError if it has more than `largest` bytes."""
    pieces, count = [], 0
    while count <= largest and (piece := stream.read(min(_PIECE, largest + 1 - count))):
        pieces.append(piece)
        count += len(piece)
    if count > largest:
        raise OSError(errno.EFBIG, f"it is too large; at most {largest} bytes are allowed")
    return pieces[0] if len(pieces) == 1 else b"".join(pieces)


def read_regular(path: Path, largest: int = LARGEST) -> bytes:
    """The content of a regular file. Raises OSError as `open_regular`, and if it has more than `largest` bytes."""
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > largest:
            raise OSError(errno.EFBIG, f"it is too large: {size} bytes; at most {largest} are allowed", str(path))
        return read_pieces(file, largest)


def read_bytes(path: Path, noun: str = "", largest: int = LARGEST) -> bytes:
    """The content of a regular file.

    noun: the kind of file, for messages. largest: most bytes that the file may have. Raises InputError with the file
    and the reason.
    """
    try:
        return read_regular(path, largest)
    except OSError as error:
        raise InputError(f"can't read {_named(path, noun)}: {error.strerror or error}") from error


def read_text(path: Path, noun: str = "", largest: int = LARGEST) -> str:
    """The text of a regular file in UTF-8, without a byte order mark; all its lines end with a line feed.

    noun, largest and InputError as for `read_bytes`.
    """
    try:
        text = read_bytes(path, noun, largest).decode("utf-8-sig")
        return text.replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise InputError(f"can't read {_named(path, noun)}: it is not UTF-8 text") from error


def _named(path: Path, noun: str) -> str:
    return f"{noun} {path}" if noun else str(path)


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file as a whole, text as UTF-8. Raises InputError; the file is as before then."""
    with atomic_write(path) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)


def check_writable(path: Path, inputs: Iterable[Path | None] = ()) -> None:
    """Check an output before long work. Raise InputError if its folder is missing, or if it would replace an input.

    inputs: as for `check_not_input`.
    """
    try:
        if not Path(os.path.realpath(path)).parent.is_dir():  # Path.resolve raises RuntimeError for a loop of links
            raise InputError(f"can't write {path}: there is no folder {path.parent}")
        if path.is_dir():
            raise InputError(f"can't write {path}: this is a folder")
    except OSError as error:
        raise InputError(f"can't write {path}: {error.strerror or error}") from error
    check_not_input(path, inputs)


def check_not_input(path: Path, inputs: Iterable[Path | None]) -> None:
    """Raise InputError if a file that will be written is one of the inputs, under this name or another.

    inputs: files that the program reads; None for those that were not given. They are iterated over only if there is
    such a file already.
    """
    if is_file(path) and any(each is not None and is_file(each) and path.samefile(each) for each in inputs):
        raise InputError(f"{path} is an input and would be overwritten; give another output")


def takes_more(descriptor: int) -> bool:
    """Whether a descriptor takes select.PIPE_BUF bytes without waiting: a full pipe does not. Raises OSError."""
    poll = select.poll()
    poll.register(descriptor, select.POLLOUT)
    return bool(poll.poll(0))
