"""Run a daemon from the command line, and say why if it can't start."""

from __future__ import annotations

import asyncio
import os
import signal
import threading
from collections.abc import Awaitable, Callable

from ..errors import NetworkError, VisualMeshError
from ..live.daemon import EXIT_CONFIGURATION, EXIT_RESTART, Daemon
from ..live.log import EventLog
from .program import EXIT_INTERRUPTED


def run_daemon(log: EventLog, prepare: Callable[[], Awaitable[Daemon]]) -> int:
    """Prepare a daemon and run it until it is stopped. Returns its exit status, also if it can't start."""
    for number in (signal.SIGHUP, signal.SIGUSR1):
        signal.signal(number, signal.SIG_IGN)  # the daemon handles them once it runs
    try:
        return _end(asyncio.run(_prepare_and_run(prepare)))
    except VisualMeshError as error:
        return report_failed_start(log, error)
    except RuntimeError as error:
        if "can't start new thread" not in str(error):
            raise
        log("stopped", "error", reason=str(error))
        return _end(EXIT_RESTART)
    except KeyboardInterrupt:  # before the daemon handles signals
        return EXIT_INTERRUPTED


async def _prepare_and_run(prepare: Callable[[], Awaitable[Daemon]]) -> int:
    daemon = await prepare()
    return await daemon.run()


def _end(status: int) -> int:
    """Return the exit status, or end the process with it if a thread still works, for example reads the camera.

    Python's own end would abort the process as soon as such a thread returns from a library like FFmpeg.
    """
    if any(each.daemon for each in threading.enumerate()):
        os._exit(status)
    return status


def report_failed_start(log: EventLog, error: VisualMeshError) -> int:
    """Log why the daemon can't start, and return the exit status that tells systemd whether to restart it."""
    log("can't start", "error", reason=str(error))
    return EXIT_RESTART if isinstance(error, NetworkError) else EXIT_CONFIGURATION
