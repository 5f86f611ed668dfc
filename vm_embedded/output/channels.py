"""Where messages go, several ways at once: standard output, a file, UDP, a Unix socket with many readers.

Nobody who reads slowly holds the detector up: what does not fit is dropped and counted.
"""

from __future__ import annotations

import asyncio
import os
import queue
import select
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from ..config.entries import check_entries, entry, number, one_of, switch, text_line
from ..errors import InputError
from ..sockets import UnixListener, checked_address, datagram_socket, parse_address
from .messages import Message, to_json_line, to_ros

FORMATS = ("json", "ros")


@dataclass(frozen=True, kw_only=True)
class OutputSettings:
    """Section [output]."""

    stdout: bool = switch(True, "lines on standard output")
    file: str = text_line("", "file that lines are appended to")
    udp: str = entry(
        checked_address, "", "where each line is sent as a datagram: ADDRESS:PORT, several with commas between"
    )
    unix: str = text_line("", "socket that is made; every reader of it gets every line")
    format: str = one_of(FORMATS, "json", "json, or ros: the field names of vision_msgs and geometry_msgs of ROS 2")
    frame_id: str = text_line("base_footprint", "what ROS is to call the frame on the ground below the camera")
    backlog_kib: int = number(256, "how far a reader may lag behind before it loses lines", "KiB", (1, 65536))

    def __post_init__(self) -> None:
        check_entries(self)


class Output(Protocol):
    """One way out. dropped: lines that were lost on it. failure: why the last one was, if not because of a slow
    reader."""

    dropped: int
    failure: str

    def send(self, line: bytes) -> None:
        """Send a line, or drop it; never wait."""

    async def close(self) -> None:
        """Send what waits, if it goes at once, and end."""


class Channels:
    """All ways out."""

    def __init__(self, settings: OutputSettings) -> None:
        self.settings = settings
        self._outputs: list[Output] = []

    async def open(self) -> None:
        """Make sockets and open files. Raises InputError."""
        settings, most = self.settings, 1024 * self.settings.backlog_kib
        try:
            if settings.stdout:
                if sys.stdout is None:
                    raise InputError("standard output is closed; --no-output-stdout goes without it")
                self._outputs.append(DescriptorChannel(os.dup(sys.stdout.fileno()), most))
            if settings.file:
                self._outputs.append(DescriptorChannel(_opened(settings.file), most))
            for each in filter(None, settings.udp.split(",")):
                self._outputs.append(DatagramChannel(each))
            if settings.unix:
                self._outputs.append(await UnixChannel.open(settings.unix, most))
        except InputError:
            await self.close()
            raise

    @property
    def dropped(self) -> int:
        """Lines that were lost, over all ways."""
        return sum(each.dropped for each in self._outputs)

    @property
    def failure(self) -> str:
        """Why lines are lost; nothing if they are not, or only to slow readers."""
        return next((each.failure for each in self._outputs if each.failure), "")

    def send(self, message: Message) -> None:
        """Send a message all ways."""
        line = to_json_line(to_ros(message, self.settings.frame_id) if self.settings.format == "ros" else message)
        for each in self._outputs:
            each.send(line)

    async def close(self) -> None:
        """End all of them."""
        for each in self._outputs:
            await each.close()
        self._outputs.clear()


def _opened(path: str) -> int:
    try:
        return os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise InputError(f"can't write {path}: {error.strerror or error}") from error


class DescriptorChannel:
    """A file, pipe or terminal, written by a thread of its own: whatever it is may hold a writer up."""

    def __init__(self, descriptor: int, most: int) -> None:
        self.dropped = 0
        self.failure = ""
        self._descriptor = descriptor
        self._most, self._given, self._written = most, 0, 0  # bytes; each is changed by one thread only
        self._lines: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._write, name="output", daemon=True)
        self._thread.start()

    def send(self, line: bytes) -> None:
        """Hand a line to the thread."""
        if self._given - self._written + len(line) > self._most:
            self.dropped += 1
            return
        self._given += len(line)
        self._lines.put(line)

    def _write(self) -> None:
        torn = False
        while (line := self._lines.get()) is not None:
            rest = memoryview(b"\n" + line if torn else line)  # nobody should take the next line for more of this one
            try:
                while rest:
                    rest = rest[self._some(rest) :]
                self.failure, torn = "", False
            except OSError as error:  # a full disk, or a reader that has gone: the others go on
                self.failure, torn = error.strerror or str(error), torn or len(rest) < len(line)
                self.dropped += 1
            self._written += len(line)
        os.close(self._descriptor)

    def _some(self, rest: memoryview) -> int:
        """Write what can be written, once something can."""
        while True:
            try:
                return os.write(self._descriptor, rest)
            except BlockingIOError:
                select.select([], [self._descriptor], [])

    async def close(self) -> None:
        """Give the thread a moment; one that hangs in a write ends with the process."""
        self._lines.put(None)
        await asyncio.to_thread(self._thread.join, 0.3)


class DatagramChannel:
    """UDP."""

    def __init__(self, where: str) -> None:
        self.dropped = 0
        self.failure = ""
        self._socket, self._address = datagram_socket(*parse_address(where, "[output] udp"), "can't send to")

    def send(self, line: bytes) -> None:
        """Send a line as a datagram."""
        try:
            self._socket.sendto(line, self._address)
        except OSError:  # nobody listens, no route, or the line is too long for a datagram
            self.dropped += 1

    async def close(self) -> None:
        """Give the socket back."""
        self._socket.close()


class UnixChannel:
    """A Unix socket with any number of readers."""

    def __init__(self, file: UnixListener, most: int) -> None:
        self.dropped = 0
        self.failure = ""
        self._file, self._most = file, most
        self._writers: set[asyncio.StreamWriter] = set()
        self._server: asyncio.Server | None = None

    @classmethod
    async def open(cls, path: str | Path, most: int) -> UnixChannel:
        """Listen at a path. Raises InputError."""
        output = cls(UnixListener(path), most)
        output._server = await asyncio.start_unix_server(output._serve, sock=output._file.socket)
        return output

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        try:
            while await reader.read(4096):  # readers have nothing to say; the end of it says that they left
                pass
        except (ConnectionError, asyncio.CancelledError):  # the latter asyncio would take for a failure
            pass
        finally:
            self._writers.discard(writer)
            writer.close()

    def send(self, line: bytes) -> None:
        """Send a line to all who keep up."""
        for writer in self._writers:
            if writer.transport.get_write_buffer_size() + len(line) > self._most:
                self.dropped += 1
            else:
                writer.write(line)

    async def close(self) -> None:
        """Stop listening, and let go of the readers."""
        if self._server is not None:
            self._server.close()
        for writer in list(self._writers):
            writer.close()
        self._file.close()
