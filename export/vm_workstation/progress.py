"""How far a long run is."""

from __future__ import annotations

import sys
import time


class Ticker:
    """Progress of a program with the time left, on standard error: a bar at a terminal, else a line a minute."""

    def __init__(self, total: int, program: str = "vm-synth", done: int = 0) -> None:
        self.done = self._before = done
        self._program = program
        self._total = total
        self._terminal = sys.stderr.isatty()
        self._start = self._shown = time.monotonic()

    @property
    def took(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self._start

    def count(self) -> None:
        """One more is done."""
        self.done += 1
        now = time.monotonic()
        if self._terminal and (now - self._shown >= 0.1 or self.done == self._before + 1):
            self._shown = now
            filled = 30 * self.done // self._total
            bar = f"[{'#' * filled}{'.' * (30 - filled)}] {self._text()}"
            print(f"\r{bar}\x1b[K", end="", file=sys.stderr, flush=True)
        elif not self._terminal and now - self._shown >= 60.0:
            self._shown = now
            print(f"{self._program}: {self._text()}", file=sys.stderr, flush=True)

    def end(self) -> None:
        """Take the bar away."""
        if self._terminal and self.done > self._before:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)

    def _text(self) -> str:
        left = int((self._total - self.done) * self.took / max(self.done - self._before, 1))
        return f"{self.done}/{self._total}, {left // 3600}:{left // 60 % 60:02d}:{left % 60:02d} left"
