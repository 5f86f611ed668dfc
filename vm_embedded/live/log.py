"""Log events on standard error, one line each: text on a terminal, JSON otherwise."""

from __future__ import annotations

import os
import sys
import threading
import time
from dataclasses import dataclass
from typing import Any, TextIO

from ..borders.text import printable, to_json
from ..files import takes_more

_MOST_LINES, _PERIOD = 50, 10.0
"""Most lines about one kind of event in a period [s]."""


class EventLog:
    """Writes events, at most 50 of a kind in ten seconds; the next one then counts those that were left out.

    Any thread may log; each event is one whole line. An event is left out, too, if nobody reads the pipe or terminal
    that the log goes to: the detector must not wait for a reader. If the log can't be written, it is silent from then
    on; the detector keeps running.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or _copy_of_standard_error()
        self._text = self._stream.isatty()
        self._recent: dict[str, _Recent] = {}
        self._lock = threading.Lock()

    def __call__(self, event: str, level: str = "info", **fields: Any) -> None:
        """Log an event with its fields. The text form leaves out empty ones."""
        with self._lock:
            self._write(event, level, fields)

    def _write(self, event: str, level: str, fields: dict[str, Any]) -> None:
        recent = self._recent.setdefault(event, _Recent())
        if not _takes_more(self._stream):
            recent.left_out += 1
            return
        left_out = recent.count(time.monotonic())
        if left_out is None:
            return
        if left_out:
            fields["left_out"] = left_out
        if self._text:
            details = ", ".join(f"{name} {value}" for name, value in fields.items() if value not in (None, ""))
            line = f"{time.strftime('%H:%M:%S')} {level:7} {event}{': ' if details else ''}{details}"
        else:
            now = round(time.time(), 3)
            line = to_json({"time": now, "level": level, "event": event, **fields}, default=str)
        try:
            self._stream.write(printable(line) + "\n")
            self._stream.flush()
        except (OSError, ValueError):  # a full disk, a closed terminal
            self._stream = open(os.devnull, "w")  # noqa: SIM115, PTH123


def _copy_of_standard_error() -> TextIO:
    """Standard error under another descriptor: while an image is decoded, descriptor 2 is a file in memory."""
    try:
        return open(os.dup(sys.stderr.fileno()), "w", errors="backslashreplace")  # noqa: PTH123
    except OSError:  # it is in memory
        return sys.stderr


def _takes_more(stream: TextIO) -> bool:
    """Whether a stream takes a line without waiting: a full pipe does not."""
    try:
        return takes_more(stream.fileno())
    except (OSError, ValueError):  # it is in memory, or closed
        return True


@dataclass
class _Recent:
    """The events of one kind in the current period, and how many of them were left out."""

    since: float = 0.0
    lines: int = 0
    left_out: int = 0

    def count(self, now: float) -> int | None:
        """Count an event at this time [s]. None: leave it out; else: how many were left out before it."""
        if now - self.since > _PERIOD:
            self.since, self.lines = now, 0
        self.lines += 1
        if self.lines > _MOST_LINES:
            self.left_out += 1
            return None
        before, self.left_out = self.left_out, 0
        return before
