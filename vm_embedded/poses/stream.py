"""Receiving poses: lines from a Unix socket, UDP or standard input are parsed, and go into the buffer.

{"t": 12.345, "height": 0.8, "quaternion": [w, x, y, z]}    rotation from the camera to the observation plane
{"t": 12.345, "Hoc": [[...], [...], [...], [0, 0, 0, 1]]}   the same as a matrix, with the height in row 2, column 3

t is in seconds, lengths are in meters. The parser does not trust the robot: it checks every number and rotation.
"""

from __future__ import annotations

import asyncio
import json
import os
import stat
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import number_or_nan
from ..borders.clock import wall_offset
from ..borders.sockets import Acceptor, Connections, UnixListener, datagram_socket, parse_address
from ..errors import InputError, VisualMeshError, unknown
from ..geometry.orientation import OPTICAL_TO_CAMERA, Orientation
from .buffer import PoseBuffer
from .settings import UDP_EXAMPLE, PoseSettings

_OLDEST, _EARLY = 10.0, 0.05
"""Largest age of a pose, and how far in the future it may be [s]: until then, it would keep out all good poses."""

_MOST_LINES = 64
"""Lines of a datagram that are read: it may have 32,000, and frames wait meanwhile."""

_MOST_IN_WINDOW, _WINDOW = 256, 0.064
"""Lines of a source that are read within so many seconds, four for each millisecond. A robot sends fewer. With a flood
of them, the thread of the camera would hardly ever get Python's lock, and the camera would count as lost."""

Report = Callable[[str], None]
"""Gets the reason why a pose was rejected."""


class PoseStream:
    """Receives poses in an event loop.

    poses: the accepted ones. received, bad: number of accepted and rejected lines. arrived: set at each new pose.
    """

    def __init__(self, settings: PoseSettings, report: Report) -> None:
        self.settings = settings
        self.poses = PoseBuffer(settings)
        self.received = 0
        self.rejection = ""
        """Why the last pose was rejected; empty if it was accepted."""
        self.bad = 0
        self.arrived = asyncio.Event()
        self._report = report
        self._transports: list[asyncio.BaseTransport] = []
        self._acceptor: Acceptor | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._connections = Connections()

    async def open(self) -> None:
        """Start to listen. Raises InputError if the source is not available."""
        kind, _, rest = self.settings.source.partition(":")
        loop = asyncio.get_running_loop()
        if kind == "unix":
            self._acceptor = Acceptor(UnixListener(rest, "--pose-source"), self._serve, MAX_LINE_BYTES)
        elif kind == "udp":
            host, port = parse_address(rest, "pose source", UDP_EXAMPLE)
            listening, _ = datagram_socket(host, port, "can't receive poses at", listen=True)
            transport, _ = await loop.create_datagram_endpoint(lambda: _Datagrams(self), sock=listening)
            self._transports.append(transport)
        elif self.settings.source == "stdin":
            if sys.stdin is None or not _is_waitable(sys.stdin.fileno()):
                raise InputError("pose source stdin needs a pipe, a socket or a terminal as standard input")
            reader = asyncio.StreamReader(limit=MAX_LINE_BYTES)
            pipe, _ = await loop.connect_read_pipe(
                lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(os.dup(sys.stdin.fileno()))
            )
            self._transports.append(pipe)
            self._add_task(asyncio.ensure_future(self._take_lines(reader)))

    def _add_task(self, task: asyncio.Task[None]) -> None:
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._add_task(task)
        if not self._connections.admit(writer):
            return
        with suppress(asyncio.CancelledError):  # asyncio would report it as a failure
            await self._take_lines(reader, lambda: self._connections.keep(writer))
        self._connections.remove(writer)
        writer.close()

    async def _take_lines(self, reader: asyncio.StreamReader, at_pose: Callable[[], None] = lambda: None) -> None:
        """Take lines until the end, except those that are too long. at_pose: called after each accepted pose."""
        lines = _Lines()
        with suppress(ConnectionError):
            while line := await self._read_line(reader):
                if self.take(line):
                    at_pose()
                # readline only yields if its buffer has no line: a flood would stop the frames
                await asyncio.sleep(0 if lines.admit() else lines.left)

    async def _read_line(self, reader: asyncio.StreamReader) -> bytes:
        try:
            return await reader.readline()
        except ValueError:
            self.reject(f"pose line has more than {MAX_LINE_BYTES} bytes")
            return b"\n"

    def take(self, line: bytes) -> bool:
        """Parse a received line, add its pose, and return True; report and count it if it is bad."""
        now = time.monotonic()
        if not line.strip():
            return False
        try:
            read = parse_pose_line(line, self.settings.frame == "optical")
            return self.add(self._time(read.time, now), read.orientation)
        except VisualMeshError as error:
            self.reject(str(error))
            return False

    def add(self, time: float, orientation: Orientation) -> bool:
        """Add a pose of a monotonic time [s], and return True; report and count it if it jumps or is not newer."""
        try:
            self.poses.add(time, orientation)
        except VisualMeshError as error:
            self.reject(str(error))
            return False
        self.received += 1
        self.rejection = ""
        self.arrived.set()
        return True

    def reject(self, reason: str) -> None:
        """Count a pose that can't be used, and report why."""
        self.bad += 1
        self.rejection = reason
        self._report(reason)

    def _time(self, t: float | None, now: float) -> float:
        """Monotonic time of a pose [s] from its t and its arrival at `now`. Raises InputError for an impossible t."""
        if self.settings.clock != "arrival" and t is None:
            raise InputError('pose lacks t; send t, or set [pose] clock = "arrival"')
        if self.settings.clock == "arrival" or t is None:
            return now - 1e-3 * self.settings.latency_ms
        if self.settings.clock == "wall":
            t -= wall_offset()
        if not now - _OLDEST < t < now + _EARLY:
            raise InputError(
                f"t of the pose is {t - now:+.3g} s from now on the {self.settings.clock} clock; "
                "send t of that clock, or change [pose] clock"
            )
        return t - 1e-3 * self.settings.latency_ms

    async def close(self) -> None:
        """Stop listening."""
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for transport in self._transports:
            transport.close()
        if self.settings.source == "stdin" and sys.stdin is not None:
            os.set_blocking(sys.stdin.fileno(), True)  # programs that run later share the terminal
        if self._acceptor is not None:
            self._acceptor.close()


def _is_waitable(descriptor: int) -> bool:
    mode = os.fstat(descriptor).st_mode
    return stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or os.isatty(descriptor)


class _Lines:
    """Counts the lines of a source in the present window of time."""

    def __init__(self) -> None:
        self._begun, self._count = time.monotonic(), 0

    @property
    def left(self) -> float:
        """Time until the next window [s]."""
        return max(self._begun + _WINDOW - time.monotonic(), 0.0)

    def admit(self) -> bool:
        """Count a line, and return whether it is one of the first _MOST_IN_WINDOW of its window."""
        if self.left == 0.0:
            self._begun, self._count = time.monotonic(), 0
        self._count += 1
        return self._count <= _MOST_IN_WINDOW


class _Datagrams(asyncio.DatagramProtocol):
    """Passes on the lines of datagrams, except those that are too many."""

    def __init__(self, stream: PoseStream) -> None:
        self._stream = stream
        self._lines = _Lines()

    def datagram_received(self, data: bytes, _: object) -> None:
        lines = data.split(b"\n", _MOST_LINES)
        for line in lines[:_MOST_LINES]:
            if not self._lines.admit():
                self._stream.reject(f"more than {_MOST_IN_WINDOW} pose lines in {1e3 * _WINDOW:.0f} ms")
                return
            self._stream.take(line)
        if any(lines[_MOST_LINES:]):
            self._stream.reject(f"datagram has more than {_MOST_LINES} lines")


MAX_LINE_BYTES = 4096
"""A longer line is rejected [bytes]."""

_KEYS = ("t", "height", "quaternion", "Hoc")


@dataclass(frozen=True)
class PoseLine:
    """time: t [s], None if the line has none. orientation: of the camera."""

    time: float | None
    orientation: Orientation


def parse_pose_line(line: bytes, optical: bool = False) -> PoseLine:
    """Parse a line. optical: the rotation is that of an optical frame (z forward, x right). Raises InputError."""
    if len(line) > MAX_LINE_BYTES:
        raise InputError(f"pose line has {len(line)} bytes, more than {MAX_LINE_BYTES}")
    try:
        data = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise InputError(f"pose is not valid JSON: {_shown(line)}") from error
    if not isinstance(data, dict):
        raise InputError(f'pose must be like {{"t": 1.0, "height": 0.8, "quaternion": [1, 0, 0, 0]}}: {_shown(line)}')
    for key in data:
        if key not in _KEYS:
            raise InputError(unknown("key in a pose", key[:40], _KEYS))
    try:
        return PoseLine(None if data.get("t") is None else _number(data["t"], "t"), _orientation(data, optical))
    except VisualMeshError as error:
        raise InputError(f"pose: {error}") from error


def _orientation(data: dict[str, Any], optical: bool) -> Orientation:
    if "Hoc" in data:
        if "quaternion" in data or "height" in data:
            raise InputError("give either Hoc, or height and quaternion, not both")
        hoc = np.array([_numbers(row, "a row of Hoc", 4) for row in _list(data["Hoc"], "Hoc", 4)])
        if optical:
            hoc[:3, :3] = hoc[:3, :3] @ OPTICAL_TO_CAMERA.T
        return Orientation.from_hoc(hoc)
    missing = [name for name in ("height", "quaternion") if name not in data]
    if missing:
        raise InputError(f"lacks {' and '.join(missing)}")
    height = _number(data["height"], "height")
    return Orientation.from_quaternion(height, _numbers(data["quaternion"], "quaternion", 4), optical)


def _number(value: Any, name: str) -> float:
    number = number_or_nan(value)
    if not abs(number) <= 1e15:
        raise InputError(f"{name} must be a finite number, not {str(value)[:40]}")
    return number


def _list(value: Any, name: str, count: int) -> list[Any]:
    if not isinstance(value, list) or len(value) != count:
        raise InputError(f"{name} must be a list of {count} values, not {str(value)[:40]}")
    return value


def _numbers(value: Any, name: str, count: int) -> list[float]:
    return [_number(each, name) for each in _list(value, name, count)]


def _shown(line: bytes) -> str:
    return repr(line[:60])[1:]
