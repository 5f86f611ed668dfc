"""Locks of folders, reading regular files, and writing files without losing their content or waiting for a pipe."""

from __future__ import annotations

import errno
import fcntl
import io
import os
import re
import secrets
import select
import shutil
import stat
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import IO, BinaryIO
from unicodedata import normalize

from .borders.text import utf8
from .errors import InputError

LARGEST = 2**30
"""Most bytes of a file that is read as a whole, unless its reader allows fewer."""

_PIECE = 2**20  # bytes to read at a time
_PAUSE = 0.005  # between two attempts to get a lock [s]
_SHOWN = 24  # letters of a name in the name of its unfinished file, so that file systems allow this, too


def exists(path: Path) -> bool:
    """Whether a path exists. False for one that can't be looked at, where Path.exists raises OSError."""
    return os.path.exists(path)  # noqa: PTH110


def there(path: Path) -> Path:
    """The path; if nothing is there, the existing one that differs from it only in the Unicode normal form of names.

    Systems and programs write a letter such as é as one character or as two. People see no difference.
    """
    if str(path).isascii() or exists(path):
        return path
    folder, name = there(path.parent), path.name
    if not name.isascii():
        with suppress(OSError, ValueError):
            name = _names_by_form(str(folder), folder.stat().st_mtime_ns).get(normalize("NFC", name), name)
    return folder / name


@lru_cache(16)
def _names_by_form(folder: str, _changed: int) -> dict[str, str]:
    """The names in a folder that are not ASCII, by their normal form NFC. _changed: when the folder was changed."""
    names = sorted(each.name for each in Path(folder).iterdir())
    return {normalize("NFC", name): name for name in names if not name.isascii()}


def is_file(path: Path) -> bool:
    """Whether a path is a file. False for one that can't be looked at, where Path.is_file raises OSError."""
    return os.path.isfile(path)  # noqa: PTH113


def unused_name(target: Path, ending: str = ".part") -> Path:
    """A name beside `target` that nothing has, for content that is not complete yet: hidden and random.

    A name that is left shows which run was killed: it begins with that of the target, and has this ending. It is plain
    ASCII, so that every library takes it. Create it with the mode that fails if it exists.
    """
    shown = re.sub(r"[^A-Za-z0-9._-]", "_", target.name[:_SHOWN])
    return target.parent / f".{shown}.{secrets.token_hex(8)}{ending}"


def put_in_place(part: Path, target: Path) -> None:
    """Give the file `part` the name `target`, and the mode of the file that it replaces.

    Raises OSError if that one is read-only, or is a folder; both stay as they are then.
    """
    _check_replaceable(target)
    if target.is_file():
        part.chmod(stat.S_IMODE(target.stat().st_mode))
    part.replace(target)


def _check_replaceable(target: Path) -> None:
    """Raise OSError if a file can't be replaced, because it is a folder or read-only."""
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, "this is a folder", str(target))
    if target.is_file() and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, "the file is read-only", str(target))


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """A new empty file beside `path`, which replaces `path` when the block ends without an error.

    No other run has this file. So if several write one path at once, each file is whole, and the last one stays. A
    symbolic link stays: its target is replaced. The file keeps its mode. A special file, such as a pipe, is written
    directly. Raises InputError if the file can't be written.
    """
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            yield path  # not the target: that of /dev/stdout in a pipeline has no path
            return
        target = real_path(path)
        _check_replaceable(target)
        part = unused_name(target)
        part.touch(exist_ok=False)
        try:
            yield part
            put_in_place(part, target)
        finally:
            with suppress(OSError):  # on a disk that can't be written it can't be removed
                part.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"can't write {path}: {error.strerror or error}") from error


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """A new folder beside `path`, which gets the name `path` when the block ends without an error.

    An empty folder is replaced, and gives its mode to the new one. The current folder gets the content instead, because
    a shell would stay in a replaced one. Anything else of that name stays. Missing parent folders are created. Raises
    InputError if the folder can't be written.
    """
    try:
        target = real_path(path)
        part = unused_name(target)
        part.mkdir(parents=True)
        try:
            yield part
            if target.is_dir() and target.samefile("."):
                _move_content(part, target)
            else:
                if target.is_dir():
                    part.chmod(stat.S_IMODE(target.stat().st_mode))
                part.rename(target)
        finally:
            shutil.rmtree(part, ignore_errors=True)
    except OSError as error:
        raise InputError(f"can't write {path}: {error.strerror or error}") from error


def _move_content(part: Path, target: Path) -> None:
    """Move everything in a folder to another one. Raises OSError if that one is not empty; it stays as it is then."""
    if any(target.iterdir()):
        raise OSError(errno.ENOTEMPTY, os.strerror(errno.ENOTEMPTY), str(target))
    for each in part.iterdir():
        each.rename(target / each.name)


def real_path(path: Path) -> Path:
    """The path that links lead to, also if nothing is there. Raises OSError for a path with a zero byte."""
    try:
        return Path(os.path.realpath(path))  # Path.resolve raises RuntimeError for a loop of links
    except ValueError as error:
        raise OSError(errno.EINVAL, str(error), str(path)) from error


@contextmanager
def library_path(path: Path) -> Iterator[str]:
    """A name by which a library that takes UTF-8 only, such as OpenCV, opens exactly the file `path`, in this block.

    It is absolute, because FFmpeg takes "a:b.mp4" for a protocol. A name that is not UTF-8, or that has a %, for which
    OpenCV may read a sequence of images, is replaced by a descriptor: of its folder, or if the last part is such a
    name, of the file itself, then without a suffix. Raises OSError for such a name if that does not exist, and for one
    that no file can have.
    """
    name = os.path.abspath(path)  # noqa: PTH100 (Path.absolute raises an error in a folder that was removed)
    try:
        if b"\0" in os.fsencode(name):  # libraries would open the file of the name before it
            raise ValueError("the name has a zero byte")
    except ValueError as error:
        raise OSError(errno.EINVAL, str(error), str(path)) from error
    if _is_plain(name):
        yield name
        return
    folder, last = os.path.split(name)
    opened = os.open(folder if _is_plain(last) else name, os.O_PATH)
    try:
        yield f"/proc/self/fd/{opened}/{last}" if _is_plain(last) else f"/proc/self/fd/{opened}"
    finally:
        os.close(opened)


def _is_plain(name: str) -> bool:
    """Whether libraries and the system mean the same file by a name."""
    return "%" not in name and os.fsencode(name) == utf8(name).encode()


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading.

    Reading a pipe, socket or device may wait forever, or never end. Raises OSError for those, for a folder, for a name
    that can't be a path, and if the file can't be opened. The path may be in another normal form (see `there`).
    """
    try:
        path = there(path)
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
    """The rest of a stream, as `read_up_to`. Raises OSError if it has more than `largest` bytes."""
    content = read_up_to(stream, largest + 1)
    if len(content) > largest:
        raise OSError(errno.EFBIG, f"it is too large; at most {largest} bytes are allowed")
    return content


def read_up_to(stream: IO[bytes], count: int) -> bytes:
    """The next bytes of a stream, fewer than `count` at its end, in memory only as far as they exist."""
    content = io.BytesIO()  # it grows in place, and is not copied at the end
    while content.tell() < count and (piece := stream.read(min(_PIECE, count - content.tell()))):
        content.write(piece)
    return content.getvalue()


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
    """Write a file as a whole, text as UTF-8 (see `utf8`). Raises InputError; the file is as before then."""
    with atomic_write(path) as part:
        part.write_bytes(utf8(content).encode() if isinstance(content, str) else content)


def check_writable(path: Path, inputs: Iterable[Path | None] = ()) -> None:
    """Check an output before long work.

    Raise InputError if its folder is missing, if it is a folder or read-only, or if it would replace an input.

    inputs: as for `check_not_input`.
    """
    try:
        target = real_path(path)
        if not target.parent.is_dir():
            raise InputError(f"can't write {path}: there is no folder {path.parent}")
        _check_replaceable(target)
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


@contextmanager
def locked_folder(folder: Path, patience: float = 0.0) -> Iterator[None]:
    """Hold the lock of a folder. The system releases it when the process ends, however it ends. A link has no lock.

    patience: how long to wait for another process that holds it [s]. Raises BlockingIOError if it holds it longer, and
    OSError if the folder can't be opened for reading, or if its file system has no locks.
    """
    descriptor = _lock(folder, time.monotonic() + patience)
    try:
        yield
    finally:
        os.close(descriptor)


def _lock(folder: Path, deadline: float) -> int:
    """A descriptor that holds the lock of a folder until it is closed."""
    was_there = False
    while True:
        try:
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        except FileNotFoundError:
            # A folder that was there is missing for a moment if another one takes its name.
            if not was_there or time.monotonic() >= deadline:
                raise
        else:
            was_there = True
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                # The folder may have been removed since it was opened, and another one may have its name.
                if os.path.samestat(os.fstat(descriptor), folder.lstat()):
                    return descriptor
                os.close(descriptor)
            except OSError as error:
                os.close(descriptor)
                if not isinstance(error, BlockingIOError | FileNotFoundError) or time.monotonic() >= deadline:
                    raise
        time.sleep(_PAUSE)
