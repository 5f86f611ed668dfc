"""Thousands of silent connections to each socket of a detector: frames go on, the status answers, the log is short."""

from __future__ import annotations

import resource
import socket
import struct
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.vm_embedded.live.running import LENS
from tests.vm_embedded.poses.test_stream import MOTION, Sender

from .detectors import Detector, detector, status

SOCKETS = ("poses", "lines", "control", "page", "metrics")

_LIMIT = 5
"""Longest time to connect [s]."""

_AT_ONCE = 100
"""Connections that are made without a pause."""

_PAUSE = 0.05
"""Pause after these, and between two questions for the status [s]."""


@dataclass
class ConnectionsReport:
    """What connections to one socket did.

    connections: that were made, in connecting_s [s]. before, during: frames per second. status_s: longest time that the
    status took to answer [s]. lines: that were logged. unexpected: as of a detector.
    """

    socket: str
    connections: int
    connecting_s: float
    before: float
    during: float
    status_s: float
    lines: int
    unexpected: list[str]

    def __str__(self) -> str:
        return "\n".join(
            [
                f"{self.socket:8} {self.connections} connections in {self.connecting_s:.0f} s: "
                f"{self.before:.1f} frames per second before, {self.during:.1f} during "
                f"({100.0 * self.during / self.before:.0f} %), status within {1e3 * self.status_s:.0f} ms, "
                f"{self.lines} lines logged",
                *self.unexpected[:10],
            ]
        )


def soak_connections(folder: Path, count: int = 5000, seconds: float = 10.0) -> list[ConnectionsReport]:
    """Open `count` connections to each socket, with a detector of its own for each. seconds: how long the frame rate is
    measured before the first connection, and at least from it on [s]; a detector takes its time to accept them all.
    Raises TimeoutError, or OSError if the detector refuses to be connected to."""
    allow_descriptors(count + 200)
    return [_soak_socket(folder / name, name, count, seconds) for name in SOCKETS]


def allow_descriptors(count: int) -> None:
    """Let this process open that many files."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (count, max(count, most)))


def _soak_socket(folder: Path, name: str, count: int, seconds: float) -> ConnectionsReport:
    folder.mkdir(parents=True)
    (folder / "vm.toml").write_text(LENS)
    addresses: dict[str, Any] = {each: str(folder / each) for each in ("poses", "lines", "control")}
    addresses |= zip(("page", "metrics"), _free_addresses(2), strict=True)
    options = (
        *("--config", folder / "vm.toml", "--camera", "synthetic", "--pose-source", f"unix:{addresses['poses']}"),
        *("--output-unix", addresses["lines"]),
        *(
            "--status-page",
            "{}:{}".format(*addresses["page"]),
            "--status-metrics",
            "{}:{}".format(*addresses["metrics"]),
        ),
    )
    with detector(folder, *options) as found, ExitStack() as stack:
        found.wait(lambda: bool(found.states))
        poses = Sender(_connected(addresses["poses"], stack).sendall, MOTION)
        poses.start()
        found.wait(found.is_ok)
        before = _rate(found, time.monotonic() + seconds, lambda: True)
        waits: list[float] = []
        connected: list[float] = []
        began = time.monotonic()

        def connect() -> bool:
            for _ in range(min(_AT_ONCE, count - len(connected))):
                _connected(addresses[name], stack)
                connected.append(time.monotonic())
            asked = time.monotonic()
            status(folder)
            waits.append(time.monotonic() - asked)
            return len(connected) == count

        during = _rate(found, began + seconds, connect)
        poses.on = False
        found.stop()
    lines = sum(found.events.values())
    took = connected[-1] - began
    return ConnectionsReport(name, len(connected), took, before, during, max(waits), lines, found.unexpected)


def _free_addresses(count: int) -> list[tuple[str, int]]:
    """Addresses of TCP at which nothing listens, all different."""
    with ExitStack() as stack:
        made = [stack.enter_context(socket.socket()) for _ in range(count)]
        for each in made:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname() for each in made]


def _rate(found: Detector, until: float, act: Callable[[], bool]) -> float:
    """Frames per second while something is done again and again, until then and until it says that all is done."""
    frames, began = found.frames, time.monotonic()
    while not act() or time.monotonic() < until:
        time.sleep(_PAUSE)
    return (found.frames - frames) / (time.monotonic() - began)


def _connected(address: Any, stack: ExitStack) -> socket.socket:
    """A connection that stays open until the end."""
    made = socket.socket(socket.AF_UNIX if isinstance(address, str) else socket.AF_INET)
    stack.enter_context(made)
    # settimeout would give up at once while other connections wait to be accepted.
    made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", _LIMIT, 0))
    made.connect(address)
    return made
