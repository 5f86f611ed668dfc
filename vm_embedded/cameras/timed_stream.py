"""A connection whose reads end at a deadline, however slowly the other side sends."""

from __future__ import annotations

import io
import math
import socket
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing_extensions import Buffer


class TimedStream(io.RawIOBase):
    """The bytes of a connected socket, in the form in which http.client uses a socket.

    A socket's own timeout begins again with each byte, so a server that sends a byte now and then holds its reader
    forever. deadline: monotonic time when reading raises TimeoutError [s]. pause: longest silence until then [s].
    Only `disconnect` closes the socket: http.client closes what it got while its response is still being read.
    """

    def __init__(self, connected: socket.socket, deadline: float) -> None:
        self.deadline, self.pause = deadline, math.inf
        self._socket = connected

    def makefile(self, mode: str) -> io.BufferedReader:
        """A buffered reader of the stream. mode: always "rb"."""
        return io.BufferedReader(self)

    def sendall(self, content: bytes) -> None:
        """Send all bytes. Raises OSError."""
        self._socket.sendall(content)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Buffer) -> int:
        """Read into a buffer. Raises OSError, also after the deadline."""
        left = self.deadline - time.monotonic()
        if left <= 0.0:
            raise TimeoutError("timed out")
        self._socket.settimeout(min(left, self.pause))
        return self._socket.recv_into(buffer)

    def readall(self) -> bytes:
        """Refuse to read until the end, which http.client does for a chunk of the length -1."""
        raise io.UnsupportedOperation("the length of a chunk is negative")

    def close(self) -> None:
        """Keep the socket open."""

    def disconnect(self) -> None:
        """Close the socket."""
        self._socket.close()
