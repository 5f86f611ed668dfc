"""Channels that write lines to a file, pipe or terminal."""

from __future__ import annotations

import errno
import os
import queue
import select
import threading

from ..errors import InputError
from .ended import ended


class DescriptorChannel:
    """A file, pipe or terminal that is open. A separate thread writes, because a write may block.

    dropped, failure: as in Channel.
    """

    def __init__(self, descriptor: int, backlog: int) -> None:
        self.dropped = 0
        self.failure = ""
        self._descriptor = descriptor
        self._backlog = backlog
        self._accepted = self._written = 0  # bytes; each is changed by one thread only
        self._lines: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._write, name="output", daemon=True)
        self._thread.start()

    def send(self, line: bytes) -> None:
        """Pass a line to the thread, unless its backlog is full."""
        if self._accepted - self._written + len(line) > self._backlog:
            self.dropped += 1
            return
        self._accepted += len(line)
        self._lines.put(line)

    def _write(self) -> None:
        torn = False  # whether the file ends in the middle of a line
        while (line := self._lines.get()) is not None:
            rest = memoryview(line)
            try:
                if self._begin_new_file():
                    torn = False
                if torn:
                    rest = memoryview(b"\n" + line)  # ends the torn line
                while rest:
                    rest = rest[self._write_some(rest) :]
                self.failure, torn = "", False
            except (OSError, InputError) as error:  # a full disk, or the reader is gone; other channels go on
                self.failure, torn = getattr(error, "strerror", None) or str(error), torn or len(rest) < len(line)
                self.dropped += 1
            self._written += len(line)
        os.close(self._descriptor)

    def _begin_new_file(self) -> bool:
        """Before a line, begin a new file if the old one is gone. Return whether; raise InputError if it fails."""
        return False

    def _write_some(self, rest: memoryview) -> int:
        """Write as many bytes as possible, waiting until at least one can be written; return their number."""
        while True:
            try:
                return os.write(self._descriptor, rest)
            except BlockingIOError:
                select.select([], [self._descriptor], [])

    async def close(self) -> None:
        """Give the thread a moment to finish; one that blocks in a write ends with the process."""
        self._lines.put(None)
        await ended(self._thread, 0.3)


class FileChannel(DescriptorChannel):
    """A file to append to. If somebody moves or deletes it, as logrotate does, the next line begins a new one.

    Raises InputError if it can't be opened.
    """

    def __init__(self, path: str, backlog: int) -> None:
        self._path = path
        super().__init__(_open_to_append(path), backlog)

    def _begin_new_file(self) -> bool:
        if self._is_at_its_path():
            return False
        descriptor = _open_to_append(self._path)
        os.close(self._descriptor)
        self._descriptor = descriptor
        return True

    def _is_at_its_path(self) -> bool:
        """Whether the path still leads to the file that is open."""
        try:
            return os.path.samestat(os.stat(self._path), os.fstat(self._descriptor))  # noqa: PTH116
        except OSError:
            return False


def _open_to_append(path: str) -> int:
    """The descriptor of a file. Raises InputError."""
    try:
        # O_NONBLOCK: a named pipe that nobody reads is an error, and does not wait for a reader.
        return os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NONBLOCK, 0o644)
    except OSError as error:
        if error.errno == errno.ENXIO:
            raise InputError(f"can't write {path}: no program reads this pipe; start its reader first") from error
        raise InputError(f"can't write {path}: {error.strerror or error}") from error
