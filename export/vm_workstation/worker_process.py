"""Signals and threads of worker processes."""

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
def interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C: it waits until the end, and processes started meanwhile inherit the block."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start_worker() -> None:
    """Prepare a worker process: leave signals to the parent, use one core, and end when the parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole process group; the parent handles it
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    cv2.setNumThreads(1)
    Thread(target=_end_with_parent, daemon=True).start()


@contextmanager
def worker_pool(
    count: int, start: Callable[..., None] = start_worker, arguments: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """A pool of `count` worker processes. At the end it cancels work that has not started.

    start: the function that each process calls first, with these arguments; it must call `start_worker`.
    Raises VisualMeshError if a worker is killed.
    """
    pool = ProcessPoolExecutor(count, get_context("spawn"), start, arguments)
    try:
        yield pool
    except BrokenProcessPool as error:
        raise VisualMeshError(
            "a worker process was killed (out of memory?): repeat the command with fewer --workers"
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _end_with_parent() -> None:
    """End this process when its parent ends, even if the parent is killed."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
