"""The control socket: each command gets a line or more of text as an answer."""

import asyncio

from .loopback import CONTROL, opened_daemon, reply

opened_daemon()


def run(data: bytes) -> None:
    answer = reply(lambda: asyncio.open_unix_connection(str(CONTROL)), data, b"\n")
    if len(data) < 1024:
        first, end, _ = answer.decode().partition("\n")
        assert end, answer
        assert first.isprintable(), answer
