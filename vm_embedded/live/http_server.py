"""A small HTTP server for the status page, its video stream and the metrics.

GET reads. POST changes something, and needs a token: in a header, so that no form of another web site can send it.
"""

from __future__ import annotations

import asyncio
import hmac
import socket
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_address
from urllib.parse import parse_qsl

from ..borders.sockets import Acceptor, Connections, UnixListener, bound_sockets, cant_listen
from ..errors import VisualMeshError

_TIMEOUT = 5.0
"""How long a browser may take to send its request, and to receive each part of the response [s]."""

_LARGEST_HEAD = 8192
"""Of a request [bytes]."""

_BACKLOG = 100
"""Browsers that may wait to be accepted."""

_MOST_STREAMS = 16

_ENDINGS = (OSError, ValueError, EOFError, asyncio.LimitOverrunError, asyncio.TimeoutError, asyncio.CancelledError)
"""How a connection may end early. Until Python 3.10, the time-out of asyncio is another error than TimeoutError."""


@dataclass(frozen=True)
class Response:
    """A response. media_type: such as text/plain."""

    media_type: str
    content: bytes


Write = Callable[[bytes], Awaitable[None]]
Query = Mapping[str, str]
"""What follows the question mark of an address."""

Page = Callable[[Query], Awaitable[Response] | Response]
"""Returns a page, or carries out an action. Raises VisualMeshError for a wrong query."""

Stream = Callable[[Write], Awaitable[None]]


class HttpServer:
    """Serves pages, and streams that last as long as the browser is connected.

    where: ADDRESS:PORT or unix:PATH. option: with that address, for error messages. actions: what POST carries out, by
    path, if the header X-Token holds the token.
    """

    def __init__(
        self,
        where: str,
        option: str,
        pages: Mapping[str, Page],
        streams: Mapping[str, Stream] | None = None,
        actions: Mapping[str, Page] | None = None,
        token: str = "",
    ) -> None:
        self._where, self._option, self._pages = where, option, pages
        self._is_local = where.startswith("unix:")
        self._streams, self._actions = streams or {}, actions or {}
        self._token = token
        self._acceptors: list[Acceptor] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self._connections = Connections()
        self._streaming = 0  # number of streams

    async def open(self) -> None:
        """Listen. Raises InputError, and NetworkError for what may work later."""
        listening: Sequence[socket.socket]
        if self._is_local:
            listening = [UnixListener(self._where.removeprefix("unix:"), self._option)]
        else:
            listening = bound_sockets(self._where, socket.SOCK_STREAM)
            try:
                for each in listening:
                    each.listen(_BACKLOG)
            except OSError as error:  # another process has begun to listen since
                raise cant_listen(self._where, error) from error
        self._acceptors = [Acceptor(each, self._serve, _LARGEST_HEAD) for each in listening]

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if not self._connections.admit(writer):
            return
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        try:
            # asyncio logs a traceback for a canceled handler, so suppress that too.
            with suppress(*_ENDINGS):
                head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), _TIMEOUT)
                self._connections.keep(writer)
                await self._respond(head.decode("latin-1").split("\r\n"), writer)
        finally:
            self._tasks.discard(task)
            self._connections.remove(writer)
            writer.close()

    async def _respond(self, head: list[str], writer: asyncio.StreamWriter) -> None:
        writer.transport.set_write_buffer_limits(0)  # so that drain waits for all of it

        async def write(content: bytes) -> None:
            writer.write(content)
            try:
                await asyncio.wait_for(writer.drain(), _TIMEOUT)
            except asyncio.TimeoutError:
                writer.transport.abort()  # close would wait for the browser forever, with an open descriptor
                raise

        method, path, *_ = [*head[0].split(" "), "", ""]
        path, _, text = path.partition("?")
        query = dict(parse_qsl(text))
        if method != "GET" and not (method == "POST" and path in self._actions):
            await write(_encode("405 Method Not Allowed", Response("text/plain", b"only GET is supported\n")))
        elif not self._is_local and not _has_numeric_host(head):
            await write(_encode("403 Forbidden", Response("text/plain", b"use the IP address, not a host name\n")))
        elif method == "POST":
            given = _header(head, "x-token") or ""
            if self._token and hmac.compare_digest(given.encode(), self._token.encode()):
                await write(await _answer(self._actions[path], query))
            else:
                await write(_encode("403 Forbidden", Response("text/plain", b"wrong token; see the log\n")))
        elif path in self._pages:
            await write(await _answer(self._pages[path], query))
        elif path in self._streams and self._streaming < _MOST_STREAMS:
            self._streaming += 1
            try:
                await self._streams[path](write)
            finally:
                self._streaming -= 1
        else:
            await write(_encode("404 Not Found", Response("text/plain", b"page not found\n")))

    async def close(self) -> None:
        """Stop listening and end all streams."""
        for each in self._acceptors:
            each.close()
        # More than once: until Python 3.11, wait_for may swallow a cancellation.
        while self._tasks:
            for task in self._tasks:
                task.cancel()
            await asyncio.wait(self._tasks, timeout=0.1)


async def _answer(page: Page, query: Query) -> bytes:
    """The response of a page or action; a wrong query gives status 400 with the reason."""
    try:
        response = page(query)
        return _encode("200 OK", response if isinstance(response, Response) else await response)
    except VisualMeshError as error:
        return _encode("400 Bad Request", Response("text/plain; charset=utf-8", f"{error}\n".encode()))


def _header(head: list[str], name: str) -> str | None:
    """The value of the first header of a name in lower case."""
    values = [line.partition(":")[2].strip() for line in head[1:] if line.lower().startswith(f"{name}:")]
    return values[0] if values else None


def _has_numeric_host(head: list[str]) -> bool:
    """Whether a request without or with a header Host is allowed, see is_numeric_host."""
    host = _header(head, "host")
    return host is None or is_numeric_host(host)


def is_numeric_host(host: str) -> bool:
    """Whether a header Host, ADDRESS or ADDRESS:PORT, names localhost or an IP address.

    Another web site could point its own name at this machine and read the responses (DNS rebinding), so names are
    rejected.
    """
    host = host.rpartition(":")[0] if host.rpartition(":")[2].isdigit() else host
    try:
        return host == "localhost" or bool(ip_address(host.strip("[]")))
    except ValueError:
        return False


def _encode(status: str, response: Response) -> bytes:
    head = (
        f"HTTP/1.1 {status}\r\nContent-Type: {response.media_type}\r\nContent-Length: {len(response.content)}\r\n"
        "Cache-Control: no-store\r\nConnection: close\r\n\r\n"
    )
    return head.encode() + response.content
