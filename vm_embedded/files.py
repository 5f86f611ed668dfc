"""Writing files so that nothing already written is lost."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """A path to write to, in the same folder, that takes the place of `path` once all went well.

    Raises InputError if it can't be written.
    """
    part = path.with_name(path.name + ".part")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        raise InputError(f"can't write {path}: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)
