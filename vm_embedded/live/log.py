"""Log events on standard error, one line each: text on a terminal, JSON otherwise."""

from __future__ import annotations

import json
import os
import sys
import time
from typing import Any, TextIO


class EventLog:
    """Writes events. If the log can't be written, it is silent from then on; the detector keeps running."""

    def __init__(self, program: str, stream: TextIO | None = None) -> None:
        self.program = program
        self._stream = stream or sys.stderr or open(os.devnull, "w")  # noqa: SIM115, PTH123
        self._text = self._stream.isatty()

    def __call__(self, event: str, level: str = "info", **fields: Any) -> None:
        """Log an event with its fields. The text form leaves out empty ones."""
        if self._text:
            details = ", ".join(f"{name} {value}" for name, value in fields.items() if value not in (None, ""))
            line = f"{time.strftime('%H:%M:%S')} {level:7} {event}{': ' if details else ''}{details}"
        else:
            now = round(time.time(), 3)
            line = json.dumps({"time": now, "level": level, "event": event, **fields}, default=str)
        try:
            print(" ".join(line.split("\n")), file=self._stream, flush=True)
        except (OSError, ValueError):  # a full disk, a closed terminal
            self._stream = open(os.devnull, "w")  # noqa: SIM115, PTH123
