"""The control socket: it asks a running detector for its status and sends it commands, one word for one reply."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from ..borders.sockets import Acceptor, Connections, UnixListener, socket_path
from ..errors import InputError

NAME = "vm-detect.sock"

REFUSED = "refused: "
"""Prefix of the reply to a command that could not be carried out."""

_TIMEOUT = 2.0
"""How long a client waits for the reply, and the server for the command [s]."""

_LARGEST_REPLY = 2**20
"""Bytes."""

Command = Callable[[], str]
"""Carries out a command and returns the reply."""


def control_path(configured: str) -> Path:
    """Path of the socket; configured: [status] socket, or empty. Raises InputError without a safe folder for it."""
    return socket_path(configured or NAME)


class ControlServer:
    """Replies to commands on a Unix socket."""

    def __init__(self, path: Path, commands: Mapping[str, Command]) -> None:
        self._path, self._commands = path, commands
        self._acceptor: Acceptor | None = None
        self._connections = Connections()

    async def open(self) -> None:
        """Listen. Raises InputError."""
        self._acceptor = Acceptor(UnixListener(self._path, "--status-socket"), self._reply, 1024)

    async def _reply(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if not self._connections.admit(writer):
            return
        try:
            # asyncio logs a traceback for a canceled handler, so suppress that too.
            with suppress(OSError, ValueError, asyncio.TimeoutError, asyncio.CancelledError):
                word = (await asyncio.wait_for(reader.readline(), _TIMEOUT)).decode("ascii", "replace").strip()
                command = self._commands.get(word)
                self._connections.keep(writer)
                reply = command() if command else f"unknown command {word!r}; allowed: {', '.join(self._commands)}"
                writer.write(reply.encode() + b"\n")
                await asyncio.wait_for(writer.drain(), _TIMEOUT)
        finally:
            self._connections.remove(writer)
            writer.close()

    async def close(self) -> None:
        """Stop listening."""
        if self._acceptor is not None:
            self._acceptor.close()


def ask(path: Path, word: str) -> str:
    """Send a command to the detector that listens at a path, and return its reply. Raises InputError without one."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(_TIMEOUT)
        deadline = time.monotonic() + _TIMEOUT
        try:
            _connect(connection, path, deadline)
            connection.sendall(word.encode() + b"\n")
            reply = b""
            while (part := connection.recv(65536)) and len(reply) < _LARGEST_REPLY:
                reply += part
                connection.settimeout(max(deadline - time.monotonic(), 1e-3))
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error) or "no reply"
            raise InputError(f"no detector replies at {path}: {reason}") from error
    return reply.decode("utf-8", "replace").strip()


def _connect(connection: socket.socket, path: Path, deadline: float) -> None:
    """Connect, and try again until the deadline [s] if too many others wait to be accepted. Raises OSError."""
    while True:
        try:
            connection.connect(str(path))
            return
        except BlockingIOError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.005)
