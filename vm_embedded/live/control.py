"""A socket to ask a running detector how it is and to tell it what to do: a word in, one answer out."""

from __future__ import annotations

import asyncio
import os
import socket
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from ..errors import InputError
from ..sockets import UnixListener

NAME = "vm-detect.sock"

_SECONDS = 2.0
"""How long who asks waits for an answer."""

_LARGEST = 2**20
"""Bytes of an answer."""

Command = Callable[[], str]
"""Does what a word says, and answers with text."""


def usual_path() -> Path:
    """Where the socket is unless the configuration says otherwise: where systemd or the session keeps such things."""
    for variable in ("RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"):
        folder = os.environ.get(variable, "").split(":")[0]
        if folder:
            return Path(folder) / NAME
    return Path(f"/tmp/vm-detect-{os.getuid()}.sock")


class Control:
    """Answers at a socket."""

    def __init__(self, path: Path, commands: Mapping[str, Command]) -> None:
        self._path, self._commands = path, commands
        self._file: UnixListener | None = None
        self._server: asyncio.Server | None = None

    async def open(self) -> None:
        """Listen. Raises InputError."""
        self._file = UnixListener(self._path)
        self._server = await asyncio.start_unix_server(self._answer, sock=self._file.socket, limit=1024)

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        # asyncio takes a handler that was cancelled for one that failed, and says so at length.
        with suppress(OSError, ValueError, TimeoutError, asyncio.CancelledError):
            word = (await asyncio.wait_for(reader.readline(), _SECONDS)).decode("ascii", "replace").strip()
            command = self._commands.get(word)
            answer = command() if command else f"unknown command {word!r}; known are {', '.join(self._commands)}"
            writer.write(answer.encode() + b"\n")
            await asyncio.wait_for(writer.drain(), _SECONDS)
        writer.close()

    async def close(self) -> None:
        """Stop listening."""
        if self._server is not None:
            self._server.close()
        if self._file is not None:
            self._file.close()


def ask(path: Path, word: str) -> str:
    """The answer of the detector that listens at a path. Raises InputError if none does, or none comes."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(_SECONDS)
        try:
            connection.connect(str(path))
            connection.sendall(word.encode() + b"\n")
            answer, deadline = b"", time.monotonic() + _SECONDS
            while (part := connection.recv(65536)) and len(answer) < _LARGEST:
                answer += part
                connection.settimeout(max(deadline - time.monotonic(), 1e-3))
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or str(error) or "no answer"
            raise InputError(f"no detector answers at {path}: {why}") from error
    return answer.decode("utf-8", "replace").strip()
