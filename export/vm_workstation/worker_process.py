"""Worker processes: their signals and threads, and work on many items in several of them."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from threading import Thread
from typing import Any, TypeVar

import cv2

from vm_embedded.errors import InputError, VisualMeshError

Work = TypeVar("Work")
Result = TypeVar("Result")


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


def check_shared_memory() -> None:
    """Raise InputError if the system gives no shared memory, without which worker processes can't be connected.

    Programs call it before they create a folder.
    """
    try:
        get_context("spawn").Lock()
    except (OSError, ImportError) as error:
        raise InputError(
            f"worker processes need shared memory, but /dev/shm can't be used ({getattr(error, 'strerror', error)}): "
            "mount it writable (docker run --shm-size 1g), or give the fewest --workers that the program allows"
        ) from error


@contextmanager
def worker_pool(
    count: int, start: Callable[..., None] = start_worker, arguments: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """A pool of `count` worker processes. At the end it cancels work that has not started.

    start: the function that each process calls first, with these arguments; it must call `start_worker`.
    Raises VisualMeshError if a worker is killed, and InputError as `check_shared_memory` does.
    """
    check_shared_memory()
    pool = ProcessPoolExecutor(count, get_context("spawn"), start, arguments)
    try:
        yield pool
    except BrokenProcessPool as error:
        raise VisualMeshError(
            "a worker process was killed (out of memory?): repeat the command with fewer --workers"
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def use_one_thread() -> None:
    """Make numerical libraries use one thread, in the processes that start from now on."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"


def results_of(
    make: Callable[[], Callable[[Work], Result]], items: Sequence[Work], workers: int, chunk: int = 5
) -> Generator[Result, None, None]:
    """Results of the function that `make` makes for all items, in order. Each of so many processes makes its own.

    1 uses only this process. chunk: items that a process gets at a time. Raises what the function raises, and
    VisualMeshError if a worker was killed.
    """
    if workers < 2 or len(items) <= chunk:
        if items:
            yield from map(make(), items)
        return
    use_one_thread()
    with worker_pool(min(workers, -(-len(items) // chunk)), _start, (make,)) as pool:
        with interrupts_blocked():
            results = pool.map(_work, items, chunksize=chunk)
        yield from results


_worker: Callable[[Any], Any] | None = None
"""The function of a worker process."""


def _start(make: Callable[[], Callable[[Any], Any]]) -> None:
    global _worker
    start_worker()
    _worker = make()


def _work(item: Any) -> Any:
    assert _worker is not None
    return _worker(item)


def _end_with_parent() -> None:
    """End this process when its parent ends, even if the parent is killed."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
