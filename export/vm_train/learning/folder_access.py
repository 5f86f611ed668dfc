"""Who may write to the folder of a training: a new training to an unused one, and one process at a time."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
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
    """Keep other processes from resuming the same training. Raises InputError if one already does."""
    with (folder / "run.json").open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InputError(f"another process is training in {folder}") from error
        yield
