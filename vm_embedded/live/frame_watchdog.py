"""End the process if a frame hangs: nothing else can end a call into ONNX Runtime or OpenCV."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_TICK_S, _MOST_TICKS = 0.25, 32
"""Pause between two looks at the frame [s], and their number after which it hangs: 8 s, less than WatchdogSec of the
unit. Ticks are counted, not seconds, because a stopped process (SIGSTOP) does not hang."""


class FrameWatchdog:
    """A thread that watches the frames of another thread.

    on_hang: called in the watching thread if a frame takes longer than `limit` [s]; it should end the process.
    """

    limit = _TICK_S * _MOST_TICKS

    def __init__(self, on_hang: Callable[[], None]) -> None:
        self._on_hang = on_hang
        self._frame = 0  # number of the frame in progress; 0 between frames
        self._count = 0
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="frame watchdog", daemon=True)

    def start(self) -> None:
        """Begin to watch."""
        self._thread.start()

    def close(self) -> None:
        """Stop watching."""
        self._closed.set()

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Watch what runs in this context."""
        self._count += 1
        self._frame = self._count
        try:
            yield
        finally:
            self._frame = 0

    def _watch(self) -> None:
        seen = ticks = 0
        while not self._closed.wait(_TICK_S):
            frame = self._frame
            ticks = ticks + 1 if frame and frame == seen else 0
            seen = frame
            if ticks >= _MOST_TICKS:
                self._on_hang()
                return
