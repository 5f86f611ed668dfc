"""Writing files so that nothing already written is lost."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import InputError


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """A path to write to, in the same folder, that takes the place of `path` once all went well.

    What a link leads to is replaced, not the link. A file keeps its mode. What is no ordinary file, such as a pipe, is
    written to itself. Raises InputError if it can't be written.
    """
    target = Path(os.path.realpath(path))
    part = target.with_name(target.name + ".part")
    try:
        if target.exists() and not target.is_file() and not target.is_dir():
            yield target
            return
        if target.is_file() and not os.access(target, os.W_OK):
            raise PermissionError(0, "it is read-only")
        yield part
        if target.is_file():
            part.chmod(stat.S_IMODE(target.stat().st_mode))
        part.replace(target)
    except OSError as error:
        raise InputError(f"can't write {path}: {error.strerror or error}") from error
    finally:
        with suppress(OSError):  # on a disk that can't be written there is none, or it stays
            part.unlink(missing_ok=True)


def check_writable(path: Path) -> None:
    """Raise InputError if a file can't be written for want of its folder, so that work is not done in vain."""
    if not path.resolve().parent.is_dir():
        raise InputError(f"can't write {path}: there is no folder {path.parent}")
    if path.is_dir():
        raise InputError(f"can't write {path}: it is a folder")
