"""Every write below atomic_write fails once, at each place: the old file stays, and one line says why."""

import errno
import os
from contextlib import ExitStack
from pathlib import Path
from unittest import mock

import pytest

from tests.vm_embedded.live.test_damaged_files import refused
from tests.vm_export.checkpoints import checkpoint
from vm_embedded.files import atomic_write


class FailingDisk:
    """Lets the n-th operation that writes fail, and those after it, as on a disk that became full. made: operations."""

    def __init__(self, fails_at):
        self.fails_at, self.made = fails_at, 0

    def _guarded(self, real):
        def operation(*arguments, **options):
            self.made += 1
            if self.made >= self.fails_at:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return real(*arguments, **options)

        return operation

    def __enter__(self):
        self._patches = ExitStack()
        for name in ("touch", "write_bytes", "write_text", "chmod", "replace"):
            self._patches.enter_context(mock.patch.object(Path, name, self._guarded(getattr(Path, name))))
        return self

    def __exit__(self, *_):
        self._patches.close()


def write_plainly(path):
    with atomic_write(path) as part:
        part.write_bytes(b"new")


def write_in_two_steps(path):
    with atomic_write(path) as part:
        part.write_bytes(b"half")
        part.write_text("whole")


WRITERS = {
    "bytes": ("a.json", write_plainly),
    "two steps": ("a.json", write_in_two_steps),
    "checkpoint": ("model.pt", lambda path: checkpoint().save(path)),
}


@pytest.mark.parametrize("old", [b"[detector]\nthreads = 1\n", None], ids=["old file", "no file"])
@pytest.mark.parametrize(("name", "write"), WRITERS.values(), ids=WRITERS)
def test_a_disk_that_becomes_full_at_any_step_leaves_the_old_file_and_a_line(name, write, old, tmp_path):
    path = tmp_path / name
    for fails_at in range(1, 10):
        path.unlink(missing_ok=True)
        if old is not None:
            path.write_bytes(old)
        with FailingDisk(fails_at) as disk:
            refusal = refused(lambda: write(path))
        if refusal is None:
            break
        assert refusal == f"can't write {path}: No space left on device"
        assert list(tmp_path.iterdir()) == ([] if old is None else [path])
        assert old is None or path.read_bytes() == old
    assert disk.made == fails_at - 1 >= (3 if old is None else 4)
    assert path.read_bytes() not in (old, b"half")
