"""A folder for the files of one process, in memory where possible, removed at its end."""

import tempfile
from functools import cache
from pathlib import Path

_IN_MEMORY = Path("/dev/shm")


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="vm-fuzz-", dir=_IN_MEMORY if _IN_MEMORY.is_dir() else None)


def scratch(name: str) -> Path:
    """The path of a file there."""
    return Path(_folder().name) / name
