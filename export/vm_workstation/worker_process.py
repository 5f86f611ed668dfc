"""What a worker process of the workstation's programs does first."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from threading import Thread
from typing import Any

import cv2

from vm_embedded.errors import VisualMeshError


@contextmanager
def shielded() -> Iterator[None]:
    """Ctrl-C waits, and never reaches processes that are started meanwhile: they leave it to their parent."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def begin() -> None:
    """Leave signals to the parent, keep to one core, and end with the parent, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    cv2.setNumThreads(1)
    Thread(target=_end_with_parent, daemon=True).start()


@contextmanager
def worker_pool(
    count: int, start: Callable[..., None] = begin, arguments: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """A pool of so many worker processes; at the end it cancels the work that has not begun.

    start: the function that each process calls first, with these arguments; it must call `begin`. Raises
    VisualMeshError if a worker was killed.
    """
    pool = ProcessPoolExecutor(count, get_context("spawn"), start, arguments)
    try:
        yield pool
    except BrokenProcessPool as error:
        raise VisualMeshError("a worker was killed (out of memory?)") from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _end_with_parent() -> None:
    """End this process when the one that started it is killed, which else it would outlive."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
