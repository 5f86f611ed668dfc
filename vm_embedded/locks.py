"""Locks of folders. The system releases one when its process ends, however it ends, and no file is left behind."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_PAUSE = 0.005
"""Time between two attempts to get a lock [s]."""


@contextmanager
def locked_folder(folder: Path, patience: float = 0.0) -> Iterator[None]:
    """Hold the lock of a folder; a link to one has none.

    patience: how long to wait for another process that holds it [s]. Raises BlockingIOError if it holds it longer, and
    OSError if the folder can't be opened for reading, or if its file system has no locks.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        deadline = time.monotonic() + patience
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() >= deadline:
                    raise
            time.sleep(_PAUSE)
        yield
    finally:
        os.close(descriptor)
