"""Telling systemd how a service is: sd_notify, a datagram to the socket that $NOTIFY_SOCKET names."""

from __future__ import annotations

import os
import socket
from contextlib import suppress


class Notifier:
    """Sends states to systemd, or to nobody if it did not start this process."""

    def __init__(self) -> None:
        address = os.environ.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) if address else None
        if self._socket is not None:
            self._socket.setblocking(False)
        period = os.environ.get("WATCHDOG_USEC", "")
        own = os.environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        self.watchdog = 1e-6 * int(period) if period.isdigit() and own else None
        """Seconds within which the watchdog wants to hear something, or None."""

    def send(self, **states: str | int) -> None:
        """As send(READY=1, STATUS="ok"). Who does not listen is not waited for."""
        if self._socket is not None:
            lines = "\n".join(f"{name}={' '.join(str(value).split())}" for name, value in states.items())
            with suppress(OSError):
                self._socket.sendto(lines.encode(), self._address)

    def close(self) -> None:
        """Give the socket back."""
        if self._socket is not None:
            self._socket.close()
