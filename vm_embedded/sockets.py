"""Unix sockets that are made, and addresses that are sent to."""

from __future__ import annotations

import os
import socket
import stat
from dataclasses import Field
from pathlib import Path
from typing import Any

from .errors import InputError

_LONGEST = 107
"""Bytes of a socket's path, as Linux has it."""

_MASK = 0o117
"""What the mode 0660 leaves out."""


class UnixListener:
    """A listening stream socket with a path. Raises InputError if another process listens there, or it can't be made.

    A file that a process left behind which listens no more is replaced.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        if len(os.fsencode(self.path)) > _LONGEST:
            raise InputError(f"path of a socket has more than {_LONGEST} bytes: {path}")
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
        try:
            self._clear()
            mask = os.umask(_MASK)
            try:
                self.socket.bind(str(self.path))
            finally:
                os.umask(mask)
            self.socket.listen(16)
            self.socket.setblocking(False)
            self._inode = self.path.stat().st_ino
        except OSError as error:
            self.socket.close()
            raise InputError(f"can't listen at {path}: {error.strerror or error}") from error
        except InputError:
            self.socket.close()
            raise

    def _clear(self) -> None:
        """Remove what a process has left that is no more."""
        try:
            mode = self.path.lstat().st_mode
        except FileNotFoundError:
            return
        if not stat.S_ISSOCK(mode):
            raise InputError(f"can't listen at {self.path}: there is a file that is no socket")
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as other:
            other.settimeout(1.0)
            try:
                other.connect(str(self.path))
            except ConnectionRefusedError:
                self.path.unlink(missing_ok=True)
                return
        raise InputError(f"can't listen at {self.path}: another process does")

    def close(self) -> None:
        """Stop listening, and remove the file if it is still this one's."""
        self.socket.close()
        try:
            if self.path.stat().st_ino == self._inode:
                self.path.unlink()
        except OSError:
            return


def checked_address(entry: Field[Any], value: object) -> str:
    """An entry that is ADDRESS:PORT, several with commas between, unix:PATH, or nothing. Raises InputError."""
    if not isinstance(value, str):
        raise InputError(f"{entry.name} must be a text, not {value!r}")
    for each in filter(None, value.split(",")):
        if not (each.startswith("unix:") and len(each) > len("unix:")):
            parse_address(each, entry.name)
    return value


def parse_address(text: str, what: str) -> tuple[str, int]:
    """Host and port of "192.168.0.20:5600" or "[::1]:5600". Raises InputError."""
    host, colon, port = text.strip().rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not (colon and host and port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise InputError(f"{what} must be like 127.0.0.1:5600, not {text!r}")
    return host, int(port)


def datagram_socket(host: str, port: int, what: str, listen: bool = False) -> tuple[socket.socket, tuple[object, ...]]:
    """A UDP socket that does not block, and the address to send to; bound to it to `listen`. Raises InputError."""
    try:
        family, kind, protocol, _, where = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        made = socket.socket(family, kind | socket.SOCK_CLOEXEC, protocol)
        try:
            made.setblocking(False)
            if listen:
                made.bind(where)
            elif family == socket.AF_INET:
                made.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        except OSError:
            made.close()
            raise
    except OSError as error:
        raise InputError(f"{what} {host}:{port}: {error.strerror or error}") from error
    return made, where
