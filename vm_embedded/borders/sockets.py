"""Unix sockets to listen on, a limit for connections, and addresses and sockets for UDP."""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import os
import socket
import stat
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import Field
from pathlib import Path
from typing import Any

from ..errors import InputError, InUseError, NetworkError
from ..files import locked_folder

_MAX_PATH_BYTES = 107
"""Longest path of a Unix socket on Linux [bytes]."""

_BACKLOG = 16
"""Connections to a Unix socket that may wait to be accepted."""

_AT_A_TIME, _PAUSE = 4, 0.032
"""Connections after which there is a pause, and its length [s]. A flood of them would take the processor from the
frames."""

_RETRY_PAUSE = 1.0
"""Time after which a connection is accepted again if the system had no descriptor for it [s]."""

MOST_CONNECTIONS = 64
"""Largest number of connections to a socket."""

_NO_NETWORK = (errno.EADDRNOTAVAIL, errno.ENETDOWN, errno.ENETUNREACH, errno.EHOSTUNREACH)
"""Errors of an address while the network is not up."""

_PATIENCE = 5.0
"""Longest wait for other detectors that create sockets in the same folder [s]. One takes a second at most."""

_UMASK = 0o117
"""Gives the socket's file mode 0660."""


def socket_path(path: str | Path) -> Path:
    """The path of a socket; a relative one is in the runtime folder. Raises InputError as `runtime_folder` does."""
    return Path(path) if Path(path).is_absolute() else runtime_folder() / path


def runtime_folder() -> Path:
    """Folder of the sockets whose path is relative: that of systemd or of the user's session, else one in /tmp that
    only this user may open. Raises InputError if somebody else has made that one."""
    for variable in ("RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"):
        folder = os.environ.get(variable, "").split(":")[0]
        if folder:
            return Path(folder)
    return private_folder(Path(f"/tmp/vm-detect-{os.getuid()}"))


def private_folder(folder: Path) -> Path:
    """The folder, created if it is missing. Anybody may create one in /tmp, so it is checked. Raises InputError."""
    try:
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        found = folder.lstat()
    except OSError as error:
        raise InputError(f"can't create {folder}: {error.strerror or error}") from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise InputError(
            f"{folder} must be a folder that only this user may open; remove it, or give sockets absolute paths, for "
            "example with --status-socket"
        )
    return folder


def is_listening(path: Path) -> bool:
    """Whether a process listens at a Unix socket; also true for one to which this user may not connect."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as other:
        other.settimeout(1.0)
        try:
            other.connect(str(path))
        except (FileNotFoundError, NotADirectoryError, ConnectionRefusedError):
            return False
        except OSError:
            return True
    return True


def check_free(path: Path, option: str) -> bool:
    """Raise InputError if no Unix socket can be created at a path because of its length or of what is there.

    Return whether a socket file is there on which no process listens anymore. Raises InUseError if one does. option: of
    vm-detect that gives another path.
    """
    if len(os.fsencode(path)) > _MAX_PATH_BYTES:
        raise InputError(f"the path of a socket must have at most {_MAX_PATH_BYTES} bytes: {path}")
    try:
        mode = path.lstat().st_mode
    except OSError:
        return False  # there is no such file, or `bind` says what is wrong
    if not stat.S_ISSOCK(mode):
        raise InputError(f"can't listen at {path}: this file exists and is not a socket")
    if is_listening(path):
        raise InUseError(
            f"can't listen at {path}: another process already does; stop the other vm-detect, or give another path "
            f"with {option}"
        )
    return True


class UnixListener(socket.socket):
    """A Unix stream socket that listens at a path; a relative one is in the runtime folder.

    option: of vm-detect that gives another path, for the error message. It replaces a socket file on which no process
    listens anymore. Raises InUseError if another process listens there, and InputError if the socket can't be created.

    The folder is locked from the check until the socket listens. So a file that the check finds without a listener was
    left behind: it is not that of another detector that has begun to start. `close` removes the file first, as no other
    detector replaces it while this one listens.
    """

    def __init__(self, path: str | Path, option: str) -> None:
        self.path = socket_path(path)
        self._file: tuple[int, int] | None = None
        super().__init__(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
        try:
            # Paths with the same folder must give the same lock.
            with locked_folder(Path(os.path.realpath(self.path.parent)), _PATIENCE):
                if check_free(self.path, option):
                    self.path.unlink(missing_ok=True)
                self._bind_and_listen()
        except InputError:
            self.close()
            raise
        except OSError as error:
            self.close()
            raise _cant_listen_at(self.path, option, error) from error

    def _bind_and_listen(self) -> None:
        mask = os.umask(_UMASK)
        try:
            self.bind(str(self.path))
        finally:
            os.umask(mask)
        self._file = _identity(self.path)
        self.listen(_BACKLOG)
        self.setblocking(False)

    def close(self) -> None:
        """Remove the file unless another one has replaced it, and stop listening."""
        with suppress(OSError):
            # No other file has the number of this one while the socket is open.
            if self._file is not None and _identity(self.path) == self._file:
                self.path.unlink()
        self._file = None
        super().close()


def _identity(path: Path) -> tuple[int, int]:
    """What tells a file from all others that exist. Raises OSError."""
    found = path.lstat()
    return found.st_dev, found.st_ino


def _cant_listen_at(path: Path, option: str, error: OSError) -> InputError:
    if isinstance(error, BlockingIOError):
        return InUseError(
            f"can't listen at {path}: another process holds the lock of {path.parent}; stop it, or give a path in "
            f"another folder with {option}"
        )
    return InputError(
        f"can't listen at {path}: {error.strerror or error}; give a path in a folder that you can read and write with "
        f"{option}"
    )


Serve = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]
"""Serves a connection until its end."""


class Acceptor:
    """Accepts the connections to a socket that listens, _AT_A_TIME before each _PAUSE, and serves each in a task.

    limit: largest line or head that is read from a connection [bytes]. Create it while the loop runs.
    """

    def __init__(self, listening: socket.socket, serve: Serve, limit: int) -> None:
        self._listening, self._serve, self._limit = listening, serve, limit
        listening.setblocking(False)
        self._task = asyncio.ensure_future(self._accept())

    async def _accept(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                for _ in range(_AT_A_TIME):
                    connection, _ = await loop.sock_accept(self._listening)
                    await loop.connect_accepted_socket(self._protocol, connection)
            except OSError as error:
                loop.call_exception_handler({"message": "can't accept a connection", "exception": error})
                await asyncio.sleep(_RETRY_PAUSE)
            await asyncio.sleep(_PAUSE)

    def _protocol(self) -> asyncio.StreamReaderProtocol:
        return asyncio.StreamReaderProtocol(asyncio.StreamReader(self._limit), self._serve)

    def close(self) -> None:
        """Stop accepting. Open connections remain."""
        self._task.cancel()
        # Without this, the loop would do it at its next turn, when a new connection may have the descriptor's number.
        self._task.get_loop().remove_reader(self._listening)
        self._listening.close()


class Connections:
    """The open connections of a socket that listens, at most MOST_CONNECTIONS: no program can use up all descriptors.

    A connection beyond the limit replaces the oldest one that has sent nothing useful. If there is none, it is closed
    at once.
    """

    def __init__(self) -> None:
        self._silent: dict[asyncio.StreamWriter, None] = {}  # in the order of their arrival
        self._useful: set[asyncio.StreamWriter] = set()

    def admit(self, writer: asyncio.StreamWriter) -> bool:
        """Add a new connection, or close it and return False. Call `remove` at the end of one that was admitted."""
        if len(self._silent) + len(self._useful) >= MOST_CONNECTIONS:
            oldest = next(iter(self._silent), None)
            if oldest is None:
                writer.transport.abort()
                return False
            del self._silent[oldest]
            oldest.transport.abort()
        self._silent[writer] = None
        return True

    def keep(self, writer: asyncio.StreamWriter) -> None:
        """From now on, no other connection replaces this one: it has sent something useful."""
        if writer in self._silent:
            del self._silent[writer]
            self._useful.add(writer)

    def remove(self, writer: asyncio.StreamWriter) -> None:
        """Forget a connection that has ended."""
        self._silent.pop(writer, None)
        self._useful.discard(writer)


def checked_address(entry: Field[Any], value: object) -> str:
    """Check of an entry: ADDRESS:PORT or unix:PATH, or empty. Raises InputError.

    The entry's metadata holds an example of an address for the error message.
    """
    if not isinstance(value, str):
        raise InputError(f"{entry.name} must be a string, not {value!r}")
    if "\0" in value:
        raise InputError(f"{entry.name} can't have a zero byte, as in {value!r}")
    if value and not (value.startswith("unix:") and len(value) > len("unix:")):
        parse_address(value, entry.name, entry.metadata["example"])
    return value


def checked_addresses(entry: Field[Any], value: object) -> str:
    """Check of an entry: ADDRESS:PORT, or several separated by commas, or empty. Raises InputError as
    `checked_address` does, also for unix:PATH."""
    for each in value.split(",") if isinstance(value, str) else (value,):
        if checked_address(entry, each).startswith("unix:"):
            raise InputError(f"{entry.name} must be ADDRESS:PORT, as in {entry.metadata['example']}, not {each!r}")
    return str(value)


def parse_address(text: str, name: str, example: str) -> tuple[str, int]:
    """Host and port of "192.168.0.20:5600" or "[::1]:5600". name and example: for the error message.

    Raises InputError.
    """
    host, colon, port = text.strip().rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    # Python refuses to read thousands of digits as a number.
    is_port = port.isascii() and port.isdigit() and len(port) < 6 and 0 < int(port) < 65536
    if not (colon and host and not {",", "\0"} & set(host) and is_port):
        raise InputError(f"{name} must be ADDRESS:PORT, as in {example}, with a port of at most 65535, not {text!r}")
    return host, int(port)


def is_open_to_network(address: str) -> bool:
    """Whether other machines can reach a server at ADDRESS:PORT or unix:PATH."""
    if address.startswith("unix:"):
        return False
    host = address.strip().rpartition(":")[0].removeprefix("[").removesuffix("]")
    try:
        return not ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name
        return host != "localhost"


def may_work_later(error: OSError) -> bool:
    """Whether an address fails because the network is not up: it has no such address, no route, or no name server."""
    return isinstance(error, socket.gaierror) or error.errno in _NO_NETWORK


def cant_listen(where: str, error: OSError | UnicodeError) -> InputError:
    """Why no server can listen at ADDRESS:PORT; a NetworkError for what may work later."""
    if isinstance(error, UnicodeError):
        return InputError(f"can't listen at {where}: this can't be the name of a host")
    # asyncio's own text repeats the address. An unknown host name has a negative errno.
    reason = os.strerror(error.errno) if error.errno and error.errno > 0 else error.strerror or error
    kind = NetworkError if may_work_later(error) else InUseError if error.errno == errno.EADDRINUSE else InputError
    return kind(f"can't listen at {where}: {reason}")


def bound_sockets(where: str, kind: socket.SocketKind) -> list[socket.socket]:
    """Sockets for a server at ADDRESS:PORT, one for each address of a name. Raises InputError as `cant_listen`.

    They leave out addresses that this machine lacks, if it has another one: the name localhost also has an address of
    IPv6 where that is switched off. asyncio ignores such addresses, too, but not before Python 3.13.
    """
    host, port = parse_address(where, "address", "127.0.0.1:8080")
    bound: list[socket.socket] = []
    lacking: OSError | None = None
    try:
        for family, _, protocol, _, address in socket.getaddrinfo(host, port, type=kind):
            try:
                bound.append(_bound_socket(family, kind, protocol, address))
            except OSError as error:
                if error.errno not in (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT):
                    raise
                lacking = error
        if lacking is not None and not bound:
            raise lacking
    except (OSError, UnicodeError) as error:
        for each in bound:
            each.close()
        raise cant_listen(where, error) from error
    return bound


def _bound_socket(family: int, kind: socket.SocketKind, protocol: int, address: Any) -> socket.socket:
    """A socket that is bound to an address of getaddrinfo. Raises OSError."""
    opened = socket.socket(family, kind | socket.SOCK_CLOEXEC, protocol)
    try:
        if kind == socket.SOCK_STREAM:  # connections that have just ended do not count
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if family == socket.AF_INET6:
            opened.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        opened.bind(address)
    except OSError:
        opened.close()
        raise
    return opened


def check_port(where: str, kind: socket.SocketKind) -> None:
    """Raise InputError as `cant_listen` if no server can listen at ADDRESS:PORT: bind sockets to it for a moment."""
    for each in bound_sockets(where, kind):
        each.close()


def datagram_socket(
    host: str, port: int, failure: str, listen: bool = False
) -> tuple[socket.socket, tuple[object, ...]]:
    """A non-blocking UDP socket, and the resolved address to send to.

    listen: bind the socket to that address. failure: start of the error message. Raises InputError, and NetworkError
    for what may work later.
    """
    try:
        family, kind, protocol, _, resolved = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        opened = socket.socket(family, kind | socket.SOCK_CLOEXEC, protocol)
        try:
            opened.setblocking(False)
            if listen:
                opened.bind(resolved)
            elif family == socket.AF_INET:
                opened.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        except OSError:
            opened.close()
            raise
    except OSError as error:
        reason = NetworkError if may_work_later(error) else InputError
        raise reason(f"{failure} {host}:{port}: {error.strerror or error}") from error
    except UnicodeError as error:
        raise InputError(f"{failure} {host}:{port}: this can't be the name of a host") from error
    return opened, resolved
