"""Notify systemd of the service's state as sd_notify does: with datagrams to the socket in $NOTIFY_SOCKET."""

from __future__ import annotations

import math
import os
import socket
import time
from contextlib import suppress


class SystemdNotifier:
    """Sends states to systemd; does nothing if systemd did not start this process."""

    def __init__(self) -> None:
        address = os.environ.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) if address else None
        if self._socket is not None:
            self._socket.setblocking(False)
        period = os.environ.get("WATCHDOG_USEC", "")
        own = os.environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        # Time within which the watchdog expects a notification [s].
        self._period = 1e-6 * int(period) if period.isdigit() and own else math.inf
        self._fed = 0.0  # when it was last notified

    def send(self, **states: str | int) -> None:
        """Send states, as in send(READY=1, STATUS="ok"). It never blocks."""
        if self._socket is not None:
            lines = "\n".join(f"{name}={' '.join(str(value).split())}" for name, value in states.items())
            with suppress(OSError):
                self._socket.sendto(lines.encode(), self._address)

    def feed_watchdog(self) -> None:
        """Notify the watchdog that the process works, four times per period, however often this is called."""
        now = time.monotonic()
        if now - self._fed > 0.25 * self._period:
            self._fed = now
            self.send(WATCHDOG=1)

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
