"""Reading text files, and writing files without losing the previous content or waiting for a pipe's reader."""

from __future__ import annotations

import errno
import os
import select
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import InputError


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


def check_regular(path: Path) -> None:
    """Raise OSError for a pipe, socket or device: reading it may wait forever, or never end."""
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):  # reading a folder has an error of its own
        raise OSError(errno.EINVAL, "not a regular file", str(path))


def read_text(path: Path, noun: str = "", largest: int | None = None) -> str:
    """The text of a file in UTF-8, without a byte order mark.

    noun: the kind of file, for messages. largest: most bytes that the file may have. Raises InputError with the file
    and the reason.
    """
    name = f"{noun} {path}" if noun else str(path)
    try:
        check_regular(path)
        if largest is not None and path.stat().st_size > largest:
            raise InputError(f"{name} is too large; at most {largest} bytes are allowed")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"can't read {name}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"can't read {name}: it is not UTF-8 text") from error
    except ValueError as error:  # a path with a zero byte
        raise InputError(f"can't read {name}: {error}") from error


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
