"""Poses as they come: from a Unix socket, from UDP or from standard input, into the ring buffer."""

from __future__ import annotations

import asyncio
import os
import stat
import sys
import time
from collections.abc import Callable
from contextlib import suppress

from ..errors import InputError, VisualMeshError
from ..sockets import UnixListener, datagram_socket, parse_address
from .buffer import PoseBuffer, PoseSettings
from .parsing import MAX_LINE_BYTES, parse_pose_line

Report = Callable[[str], None]
"""Takes what was wrong with a pose."""


class PoseStream:
    """Listens for poses while an event loop runs."""

    def __init__(self, settings: PoseSettings, report: Report) -> None:
        self.settings = settings
        self.poses = PoseBuffer(settings)
        self.received = 0
        self.bad = 0
        self.arrived = asyncio.Event()
        """Set whenever there is a new pose."""
        self._report = report
        self._transports: list[asyncio.BaseTransport] = []
        self._file: UnixListener | None = None
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    async def open(self) -> None:
        """Begin to listen. Raises InputError for a source that can't be had."""
        kind, _, rest = self.settings.source.partition(":")
        loop = asyncio.get_running_loop()
        if kind == "unix":
            self._file = UnixListener(rest)
            self._server = await asyncio.start_unix_server(self._converse, sock=self._file.socket, limit=MAX_LINE_BYTES)
        elif kind == "udp":
            host, port = parse_address(rest, "source of poses")
            listening, _ = datagram_socket(host, port, "poses from", listen=True)
            transport, _ = await loop.create_datagram_endpoint(lambda: _Datagrams(self.take), sock=listening)
            self._transports.append(transport)
        elif self.settings.source == "stdin":
            if sys.stdin is None or not _can_be_waited_for(sys.stdin.fileno()):
                raise InputError("poses from stdin need a pipe, a socket or a terminal there")
            reader = asyncio.StreamReader(limit=MAX_LINE_BYTES)
            pipe, _ = await loop.connect_read_pipe(
                lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(os.dup(sys.stdin.fileno()))
            )
            self._transports.append(pipe)
            self._keep(asyncio.ensure_future(self._lines(reader)))

    def _keep(self, task: asyncio.Task[None]) -> None:
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._keep(task)
        with suppress(asyncio.CancelledError):  # which asyncio would take for a failure
            await self._lines(reader)
        writer.close()

    async def _lines(self, reader: asyncio.StreamReader) -> None:
        """Take lines until the end. One that is too long is left out."""
        with suppress(ConnectionError):
            while line := await self._line(reader):
                self.take(line)

    async def _line(self, reader: asyncio.StreamReader) -> bytes:
        try:
            return await reader.readline()
        except ValueError:
            self._refuse(f"pose of more than {MAX_LINE_BYTES} bytes")
            return b"\n"

    def take(self, line: bytes) -> None:
        """A line as it came. What is wrong with it is reported and counted."""
        now = time.monotonic()
        if not line.strip():
            return
        try:
            read = parse_pose_line(line, self.settings.frame == "optical")
            self.poses.add(self._time(read.time, now), read.orientation)
        except VisualMeshError as error:
            self._refuse(str(error))
            return
        self.received += 1
        self.arrived.set()

    def _refuse(self, why: str) -> None:
        self.bad += 1
        self._report(why)

    def _time(self, stated: float | None, now: float) -> float:
        """When a pose was true, in monotonic time [s]. Raises InputError for a time that can't be."""
        if self.settings.clock != "arrival" and stated is None:
            raise InputError('pose lacks t; without a clock set clock = "arrival"')
        if self.settings.clock == "arrival" or stated is None:
            return now - 1e-3 * self.settings.latency_ms
        if self.settings.clock == "wall":
            stated += now - time.time()
        if not now - 10.0 < stated < now + 1.0:
            raise InputError(
                f"pose is of {stated - now:+.1f} s from now; does the robot count in {self.settings.clock} time?"
            )
        return stated - 1e-3 * self.settings.latency_ms

    async def close(self) -> None:
        """Stop listening."""
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for transport in self._transports:
            transport.close()
        if self.settings.source == "stdin" and sys.stdin is not None:
            os.set_blocking(sys.stdin.fileno(), True)  # a terminal is shared with whoever comes after
        if self._server is not None:
            self._server.close()
        if self._file is not None:
            self._file.close()


def _can_be_waited_for(descriptor: int) -> bool:
    mode = os.fstat(descriptor).st_mode
    return stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or os.isatty(descriptor)


class _Datagrams(asyncio.DatagramProtocol):
    """Hands each line of each datagram on."""

    def __init__(self, take: Callable[[bytes], None]) -> None:
        self._take = take

    def datagram_received(self, data: bytes, _: object) -> None:
        for line in data.splitlines():
            self._take(line)
