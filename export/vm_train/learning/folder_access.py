"""Who may write to the folder of a training: a new training to an unused one, and one process at a time."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from vm_embedded.errors import InputError


def check_unused(folder: Path, names: Sequence[str]) -> None:
    """Raise InputError if a folder holds a training, or one of the files `names`, which a new one would overwrite."""
    if (folder / "run.json").exists():
        raise InputError(f"{folder} holds a training already: vm-train resume {folder}, or give another folder")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file: give a new folder")
    present = [name for name in names if (folder / name).exists()]
    if present:
        raise InputError(f"{folder} holds {', '.join(present)}, which a training would overwrite: give a new folder")


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes from training in the same folder, which is created, and removed if it stays empty.

    The lock is that of the folder: a file in it could be replaced. Raises InputError if another process holds it.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file: give a new folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError as error:
        raise InputError(f"can't make folder {folder}: {error.strerror or error}") from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(f"another process is training in {folder}") from error
        except OSError:  # a file system without locks
            pass
        try:
            yield
        finally:
            with suppress(OSError):
                folder.rmdir()
    finally:
        os.close(descriptor)
