"""Wait until a thread has ended, without another thread: a process that has to end may get none."""

from __future__ import annotations

import asyncio
import threading
import time

_TICK = 0.01
"""Pause between two looks at the thread [s]."""


async def ended(thread: threading.Thread, seconds: float) -> None:
    """Wait up to `seconds` [s] for a thread to end. Signals and sockets are handled meanwhile."""
    deadline = time.monotonic() + seconds
    while thread.is_alive() and time.monotonic() < deadline:
        await asyncio.sleep(_TICK)
