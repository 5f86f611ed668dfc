"""The smallest HTTP server that shows a state, a moving picture and figures. It answers GET and nothing else."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_address

from ..errors import InputError
from ..sockets import UnixListener, parse_address

_SECONDS = 5.0
"""How long a browser may take to ask, and to take a part of an answer."""

_MOST = 16
"""Connections at a time."""


@dataclass(frozen=True)
class Answer:
    """kind: its media type."""

    kind: str
    content: bytes


Write = Callable[[bytes], Awaitable[None]]
Page = Callable[[], Answer]
Stream = Callable[[Write], Awaitable[None]]


class WebServer:
    """Serves pages, and streams that go on for as long as somebody looks.

    where: ADDRESS:PORT or unix:PATH.
    """

    def __init__(self, where: str, pages: Mapping[str, Page], streams: Mapping[str, Stream] | None = None) -> None:
        self._where, self._pages, self._streams = where, pages, streams or {}
        self._file: UnixListener | None = None
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    async def open(self) -> None:
        """Listen. Raises InputError."""
        if self._where.startswith("unix:"):
            self._file = UnixListener(self._where.removeprefix("unix:"))
            self._server = await asyncio.start_unix_server(self._serve, sock=self._file.socket, limit=8192)
            return
        host, port = parse_address(self._where, "[status] page and metrics")
        try:
            self._server = await asyncio.start_server(self._serve, host, port, limit=8192)
        except OSError as error:
            raise InputError(f"can't listen at {self._where}: {error.strerror or error}") from error

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        try:
            # asyncio takes a handler that was cancelled for one that failed, and says so at length.
            with suppress(OSError, ValueError, EOFError, asyncio.LimitOverrunError, asyncio.CancelledError):
                head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), _SECONDS)
                await self._answer(head.decode("latin-1").split("\r\n"), writer)
        finally:
            self._tasks.discard(task)
            writer.close()

    async def _answer(self, head: list[str], writer: asyncio.StreamWriter) -> None:
        async def write(content: bytes) -> None:
            writer.write(content)
            await asyncio.wait_for(writer.drain(), _SECONDS)

        method, path, *_ = [*head[0].split(" "), "", ""]
        path = path.partition("?")[0]
        if method != "GET":
            await write(_response("405 Method Not Allowed", Answer("text/plain", b"GET only\n")))
        elif self._file is None and not _is_own(head):
            await write(_response("403 Forbidden", Answer("text/plain", b"ask by address, not by name\n")))
        elif path in self._pages:
            await write(_response("200 OK", self._pages[path]()))
        elif path in self._streams and len(self._tasks) <= _MOST:
            await self._streams[path](write)
        else:
            await write(_response("404 Not Found", Answer("text/plain", b"there is no such page\n")))

    async def close(self) -> None:
        """Stop listening, and end all streams."""
        if self._server is not None:
            self._server.close()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        if self._file is not None:
            self._file.close()


def _is_own(head: list[str]) -> bool:
    """Whether a browser asks for this machine by address: a name could be another site's that was turned to it."""
    hosts = [line.partition(":")[2].strip() for line in head[1:] if line.lower().startswith("host:")]
    if not hosts:
        return True
    host = hosts[0].rpartition(":")[0] if hosts[0].rpartition(":")[2].isdigit() else hosts[0]
    try:
        return host == "localhost" or bool(ip_address(host.strip("[]")))
    except ValueError:
        return False


def _response(status: str, answer: Answer) -> bytes:
    head = (
        f"HTTP/1.1 {status}\r\nContent-Type: {answer.kind}\r\nContent-Length: {len(answer.content)}\r\n"
        "Cache-Control: no-store\r\nConnection: close\r\n\r\n"
    )
    return head.encode() + answer.content
