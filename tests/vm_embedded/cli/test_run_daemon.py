"""How a daemon that can't start ends."""

import signal

import pytest

from vm_embedded.cli.run_daemon import run_daemon
from vm_embedded.errors import InputError, NetworkError


@pytest.fixture(autouse=True)
def own_signals():
    before = {number: signal.getsignal(number) for number in (signal.SIGHUP, signal.SIGUSR1)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(autouse=True)
def no_other_threads(monkeypatch):
    """Those of pytest would end its process."""
    monkeypatch.setattr("threading.enumerate", list)


@pytest.mark.parametrize(
    ("error", "status", "logged"),
    [
        (InputError("no camera"), 78, [("can't start", "error", "no camera")]),
        (NetworkError("no such host"), 75, [("can't start", "error", "no such host")]),
        (RuntimeError("can't start new thread"), 75, [("stopped", "error", "can't start new thread")]),
        (KeyboardInterrupt(), 130, []),
    ],
)
def test_the_exit_status_says_whether_a_restart_may_help(error, status, logged):
    lines = []

    async def prepare():
        raise error

    assert run_daemon(lambda event, level, reason: lines.append((event, level, reason)), prepare) == status
    assert lines == logged
