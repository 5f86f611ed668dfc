"""A progress bar for a person at a terminal."""

from __future__ import annotations

import sys


class Progress:
    """A bar on standard error, if that is a terminal and the number of frames is known."""

    def __init__(self, count: int | None) -> None:
        self._count = count if count and count > 1 and sys.stderr.isatty() else None

    def show(self, done: int) -> None:
        if self._count:
            filled = 30 * done // self._count
            bar = "#" * filled + "." * (30 - filled)
            print(f"\r[{bar}] {done}/{self._count}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        if self._count:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
