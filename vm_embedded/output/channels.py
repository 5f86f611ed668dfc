"""The channels that send messages: standard output, a file, UDP, and a Unix socket with many readers.

A slow reader never blocks the detector: messages that exceed its backlog are dropped whole, and counted.
"""

from __future__ import annotations

import asyncio
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from ..borders.sockets import (
    MOST_CONNECTIONS,
    Acceptor,
    UnixListener,
    checked_addresses,
    datagram_socket,
    parse_address,
)
from ..config.entries import check_entries, entry, file_name, number, one_of, switch
from ..errors import InputError
from .binary_form import to_binary
from .file_channel import DescriptorChannel, FileChannel
from .messages import Message, to_json_line
from .readable_line import to_readable_line

_PAUSE = 0.1
"""Time between two reads of what a reader sends [s]: a flood of it would take the processor from the frames."""

UNIX_FORMATS = ("lines", "binary")

_UDP_EXAMPLE = "127.0.0.1:5600"
"""Address to send lines to, for error messages."""


@dataclass(frozen=True, kw_only=True)
class OutputSettings:
    """Section [output]: the channels, the form of the Unix socket, and the backlog of slow readers."""

    stdout: bool = switch(True, "write lines to standard output")
    file: str = file_name("", "file to append lines to")
    udp: str = entry(
        checked_addresses,
        "",
        "UDP receivers, one datagram per line: ADDRESS:PORT, separated by commas",
        example=_UDP_EXAMPLE,
    )
    unix: str = file_name(
        "",
        "Unix socket to create; each reader gets all lines that it takes in time; a relative path is in "
        "$RUNTIME_DIRECTORY, $XDG_RUNTIME_DIR or the private folder /tmp/vm-detect-UID",
    )
    unix_format: str = one_of(
        UNIX_FORMATS, "lines", "messages of the Unix socket: lines of JSON, or the compact binary form"
    )
    backlog_kib: int = number(256, "backlog after which a slow reader loses lines", "KiB", (1, 65536))

    def __post_init__(self) -> None:
        check_entries(self)


class Channel(Protocol):
    """One channel. dropped: number of messages lost. failure: why the last one was lost; empty for slow readers."""

    dropped: int
    failure: str

    def send(self, line: bytes) -> None:
        """Send a line, or a message in the binary form, or drop it; never block."""

    async def close(self) -> None:
        """Send the backlog if that is possible at once, and close."""


class Channels:
    """All channels of the settings. readable: standard output gets lines for people."""

    def __init__(self, settings: OutputSettings, readable: bool = False) -> None:
        self.settings = settings
        self._readable = readable
        self._line_channels: list[Channel] = []
        self._readable_channels: list[Channel] = []
        self._binary_channels: list[Channel] = []

    async def open(self) -> None:
        """Create sockets and open files. Raises InputError."""
        settings, backlog = self.settings, 1024 * self.settings.backlog_kib
        try:
            if settings.stdout:
                try:
                    descriptor = os.dup(sys.stdout.fileno())
                except OSError as error:
                    raise InputError("standard output is closed; use --no-output-stdout") from error
                chosen = self._readable_channels if self._readable else self._line_channels
                chosen.append(DescriptorChannel(descriptor, backlog))
            if settings.file:
                self._line_channels.append(FileChannel(settings.file, backlog))
            for each in filter(None, settings.udp.split(",")):
                self._line_channels.append(DatagramChannel(each))
            if settings.unix:
                chosen = self._binary_channels if settings.unix_format == "binary" else self._line_channels
                chosen.append(UnixChannel(settings.unix, backlog))
        except InputError:
            await self.close()
            raise

    @property
    def dropped(self) -> int:
        """Number of messages lost, over all channels."""
        return sum(each.dropped for each in self._all)

    @property
    def failure(self) -> str:
        """Why messages are lost; empty if none are, or only those of slow readers."""
        return next((each.failure for each in self._all if each.failure), "")

    @property
    def _all(self) -> list[Channel]:
        return [*self._line_channels, *self._readable_channels, *self._binary_channels]

    def send(self, message: Message) -> None:
        """Send a message on all channels."""
        if self._line_channels:
            line = to_json_line(message)
            for each in self._line_channels:
                each.send(line)
        if self._readable_channels and message["type"] == "frame":  # the log says the states
            line = to_readable_line(message).encode() + b"\n"
            for each in self._readable_channels:
                each.send(line)
        if self._binary_channels:
            encoded = to_binary(message)
            for each in self._binary_channels:
                each.send(encoded)

    async def close(self) -> None:
        """Close all channels."""
        for each in self._all:
            await each.close()
        self._line_channels.clear()
        self._readable_channels.clear()
        self._binary_channels.clear()


class DatagramChannel:
    """UDP datagrams to one address, ADDRESS:PORT."""

    def __init__(self, destination: str) -> None:
        self.dropped = 0
        self.failure = ""
        self._socket, self._address = datagram_socket(
            *parse_address(destination, "[output] udp", _UDP_EXAMPLE), "can't send to"
        )

    def send(self, line: bytes) -> None:
        """Send a line as a datagram."""
        try:
            self._socket.sendto(line, self._address)
        except OSError:  # no listener, no route, or the line is too long for a datagram
            self.dropped += 1

    async def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class UnixChannel:
    """A Unix socket with up to MOST_CONNECTIONS readers; it disconnects further ones at once.

    Raises InputError if it can't listen at the path. Create it while the loop runs.
    """

    def __init__(self, path: str | Path, backlog: int) -> None:
        self.dropped = 0
        self.failure = ""
        self._backlog = backlog
        self._writers: set[asyncio.StreamWriter] = set()
        self._acceptor = Acceptor(UnixListener(path, "--output-unix"), self._serve, limit=1)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._writers) >= MOST_CONNECTIONS:
            writer.transport.abort()
            return
        self._writers.add(writer)
        try:
            while await reader.read(4096):  # readers send nothing; an empty read means that they left
                await asyncio.sleep(_PAUSE)
        except (ConnectionError, asyncio.CancelledError):  # asyncio would report the latter as a failure
            pass
        finally:
            self._writers.discard(writer)
            writer.transport.abort()  # close would wait for a reader that only stopped sending, with an open descriptor

    def send(self, line: bytes) -> None:
        """Send a line, or a message in the binary form, to all readers that keep up."""
        for writer in self._writers:
            if writer.transport.get_write_buffer_size() + len(line) > self._backlog:
                self.dropped += 1
            else:
                writer.write(line)

    async def close(self) -> None:
        """Stop listening and disconnect the readers."""
        self._acceptor.close()
        for writer in list(self._writers):
            writer.close()
