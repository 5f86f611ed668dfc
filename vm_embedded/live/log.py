"""What happens, a line each on standard error: text for people at a terminal, JSON for everything else."""

from __future__ import annotations

import json
import os
import sys
import time
from typing import Any, TextIO


class EventLog:
    """Writes events. A log that can't be written is no reason to stop."""

    def __init__(self, program: str, stream: TextIO | None = None) -> None:
        self.program = program
        self._stream = stream or sys.stderr or open(os.devnull, "w")  # noqa: SIM115, PTH123
        self._text = self._stream.isatty()

    def __call__(self, event: str, level: str = "info", **fields: Any) -> None:
        """One event, with what belongs to it."""
        if self._text:
            said = ", ".join(f"{name} {value}" for name, value in fields.items())
            line = f"{time.strftime('%H:%M:%S')} {level:7} {event}{': ' if said else ''}{said}"
        else:
            now = round(time.time(), 3)
            line = json.dumps({"time": now, "level": level, "event": event, **fields}, default=str)
        try:
            print(" ".join(line.split("\n")), file=self._stream, flush=True)
        except (OSError, ValueError):  # a full disk, a closed terminal
            self._stream = open(os.devnull, "w")  # noqa: SIM115, PTH123
