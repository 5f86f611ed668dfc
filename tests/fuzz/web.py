"""The server of the status page: each whole request gets an answer of HTTP. TOKEN in the input is the right token."""

import asyncio

from .loopback import opened_daemon, reply

_DAEMON, _PORT = opened_daemon()


def run(data: bytes) -> None:
    request = data.replace(b"TOKEN", _DAEMON.page.token.encode())
    answer = reply(lambda: asyncio.open_connection("127.0.0.1", _PORT), request, b"multipart/x-mixed-replace")
    if b"\r\n\r\n" in request[:8192]:
        assert answer.startswith(b"HTTP/1.1 "), answer[:200]
