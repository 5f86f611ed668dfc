"""Access to the folder of a training: a new training needs an unused one, and one process at a time writes to it."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from vm_embedded.errors import InputError
from vm_embedded.files import read_regular
from vm_embedded.output.result_files import make_folder


def check_unused(folder: Path, names: Sequence[str]) -> None:
    """Raise InputError if a folder holds a training, or one of the files `names`, which a new one would overwrite."""
    if (folder / "run.json").exists():
        raise InputError(f"{folder} holds a training already: vm-train resume {folder}, or give another folder")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file: give a new folder")
    present = [name for name in names if (folder / name).exists()]
    if present:
        raise InputError(f"{folder} holds {', '.join(present)}, which a training would overwrite: give a new folder")


def kind_of(folder: Path) -> str | None:
    """The kind of training in a folder, as its run.json says; None if it says none or can't be read."""
    try:
        content = json.loads(read_regular(folder / "run.json"))
    except (OSError, ValueError, RecursionError):
        return None
    kind = content.get("kind") if isinstance(content, dict) else None
    return kind if isinstance(kind, str) else None


@contextmanager
def description(folder: Path, number: int, what: str = "training") -> Iterator[dict[str, Any]]:
    """The content of a folder's run.json, for a with statement that takes its entries. number: its format.

    Raises InputError if there is no run.json, if another release wrote it, or if it is damaged. An entry that the
    statement does not find, or that has the wrong type, also counts as damage.
    """
    path = folder / "run.json"
    try:
        content = json.loads(read_regular(path))
        if content["format"] != number:
            raise InputError(f"{path} was written by another release: begin the {what} again")
        yield content
    except OSError as error:
        raise InputError(f"{folder} holds no training: can't read run.json: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{path} is damaged: {error}") from error


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes from training in the same folder. It is created, and then removed if it stays empty.

    The lock is that of the folder: a file in it could be replaced. Raises InputError if another process holds it.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file: give a new folder")
    is_new = not folder.exists()
    make_folder(folder)
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError as error:
        raise InputError(f"can't open folder {folder}: {error.strerror or error}") from error
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
            if is_new:
                with suppress(OSError):
                    folder.rmdir()
    finally:
        os.close(descriptor)
