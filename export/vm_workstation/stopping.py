"""Stops programs cleanly."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager

_QUIET = "ignore::UserWarning:multiprocessing.resource_tracker"
"""For PYTHONWARNINGS, which the processes that a program starts inherit."""


@contextmanager
def stoppable() -> Iterator[None]:
    """SIGTERM raises KeyboardInterrupt like Ctrl-C, so schedulers can end a run at any time."""

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    # Python removes the semaphores of a program that ended at once, and would print a warning after its last line.
    warnings = os.environ.get("PYTHONWARNINGS", "")
    if _QUIET not in warnings:
        os.environ["PYTHONWARNINGS"] = f"{warnings},{_QUIET}".lstrip(",")
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
