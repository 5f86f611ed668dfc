"""The progress bar of all programs."""

from __future__ import annotations

import sys
import time

from .terminal import control_terminal

_BAR_INTERVAL, _LINE_INTERVAL = 0.1, 60.0
"""Least time between two updates [s]: of the bar at a terminal, of the lines elsewhere."""


class ProgressBar:
    """Progress on standard error: a bar with the time left at a terminal, otherwise one line per minute.

    total: number of steps; None if unknown, and then nothing is shown.
    program: name at the start of each line; None writes no lines where there is no terminal.
    done: number of steps that an earlier run has completed; the time left does not count them.
    unit: what a step is called, in the plural.

    Set `note` to what else to show, such as the loss of a training.
    """

    def __init__(self, total: int | None, program: str | None = None, done: int = 0, unit: str = "pictures") -> None:
        self.done = self._done_before = done
        self.note = ""
        self._total = total if total and total > 1 else None
        self._program, self._unit = program, unit
        self._terminal = sys.stderr.isatty()
        self._visible = False
        self._start = self._updated = time.monotonic()

    @property
    def elapsed(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self._start

    def advance(self) -> None:
        """Complete one more step."""
        self.show(self.done + 1)

    def show(self, done: int) -> None:
        """Set the number of completed steps. A smaller number than before starts over, as does the time left."""
        if done < self.done:
            self._done_before, self._start = 0, time.monotonic()
        self.done = done
        if self._total is None:
            return
        since_update = time.monotonic() - self._updated
        if self._terminal and (not self._visible or since_update >= _BAR_INTERVAL):
            self._visible, self._updated = True, time.monotonic()
            filled = 30 * done // self._total
            bar = f"[{'#' * filled}{'.' * (30 - filled)}] {self._text(self._total)}"
            control_terminal(f"\r{bar}\x1b[K")
        elif not self._terminal and self._program and since_update >= _LINE_INTERVAL:
            self._updated = time.monotonic()
            print(f"{self._program}: {self._text(self._total)}", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Remove the bar from the terminal; the next step draws it again."""
        if self._visible:
            control_terminal("\r\x1b[K")
            self._visible = False

    @property
    def left(self) -> str:
        """The time left, from the speed so far: hours, minutes and seconds."""
        steps = (self._total or self.done) - self.done
        seconds = int(steps * self.elapsed / max(self.done - self._done_before, 1))
        return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d} left"

    def _text(self, total: int) -> str:
        return ", ".join(filter(None, [f"{self.done}/{total} {self._unit}", self.left, self.note]))
