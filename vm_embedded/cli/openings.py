"""Whether the daemon can open its files, sockets and ports, as far as a program can tell without opening them.

A detector that already runs uses the same sockets and ports: that is no fault.
"""

from __future__ import annotations

import os
import socket
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from ..borders.sockets import check_free, check_port, is_listening, socket_path
from ..errors import InputError, InUseError, NetworkError
from ..live.configuration import Configuration
from ..live.control import control_path
from ..output.recorder import RecorderSettings
from .finding import BAD, GOOD, WARNING, Finding

_OF_SERVICE = ("/run/vm-detect", "/var/lib/vm-detect")
"""Folders that systemd creates for the unit of deploy/robot."""

Check = Callable[[], str]
"""Returns in words what can be opened. Raises InputError."""


class _FolderError(InputError):
    """A folder that is missing or can't be written."""

    def __init__(self, message: str, folder: Path) -> None:
        super().__init__(message)
        self.folder = folder


def check_openings(configuration: Configuration) -> Iterator[Finding]:
    """One finding for the status socket, and for each file, socket and port that the configuration names."""
    try:
        control = control_path(configuration.status.socket)
    except InputError as error:
        yield Finding("status socket", BAD, str(error), "ls -ld /tmp/vm-detect-$(id -u)")
        return
    is_running = is_listening(control)
    yield _finding("status socket", partial(_check_unix, str(control), "--status-socket"), is_running)
    for about, check in _checks(configuration):
        yield _finding(about, check, is_running)


def _checks(configuration: Configuration) -> Iterator[tuple[str, Check]]:
    """What is opened besides the status socket, each with its check."""
    output, status, recorder = configuration.output, configuration.status, configuration.recorder
    kind, _, address = configuration.pose.source.partition(":")
    if output.file:
        yield "output file", partial(_check_file, Path(output.file))
    if output.unix:
        yield "output socket", partial(_check_unix, output.unix, "--output-unix")
    if kind == "unix":
        yield "pose socket", partial(_check_unix, address, "--pose-source")
    if kind == "udp":
        yield "pose port", partial(_check_port, address, socket.SOCK_DGRAM)
    for about, where, option in (
        ("status page", status.page, "--status-page"),
        ("metrics", status.metrics, "--status-metrics"),
    ):
        if where.startswith("unix:"):
            yield about, partial(_check_unix, where.removeprefix("unix:"), option)
        elif where:
            yield about, partial(_check_port, where, socket.SOCK_STREAM)
    if recorder.folder or recorder.trigger_class:
        yield "recorder", partial(_check_recorder, recorder)


def _finding(about: str, check: Check, is_running: bool) -> Finding:
    """The finding of a check. is_running: whether a detector runs."""
    try:
        return Finding(about, GOOD, check())
    except NetworkError as error:
        return Finding(about, WARNING, str(error), "ip address shows the addresses of this machine")
    except InUseError as error:
        if is_running:
            return Finding(about, GOOD, "in use; a detector is running")
        return Finding(about, BAD, str(error), "sudo ss -lntuxp shows which program listens where")
    except _FolderError as error:
        return Finding(about, BAD, str(error), f"sudo install -d -o $USER {error.folder}")
    except InputError as error:
        return Finding(about, BAD, str(error), "change this entry of vm.toml")


def _check_file(path: Path) -> str:
    """A file to append lines to, which may not exist yet."""
    if not os.access(path, os.F_OK):
        return _check_folder(path, "can't write")
    if path.is_dir():
        raise InputError(f"can't write {path}: this is a folder; give a file")
    if not os.access(path, os.W_OK):
        raise InputError(f"can't write {path}: this user may not; give another file")
    return str(path)


def _check_unix(name: str, option: str) -> str:
    """A Unix socket to create. option: of vm-detect that gives another path."""
    path = socket_path(name)
    check_free(path, option)
    return _check_folder(path, "can't listen at", os.R_OK)


def _check_port(where: str, kind: socket.SocketKind) -> str:
    """A port, ADDRESS:PORT, to listen at."""
    check_port(where, kind)
    return where


def _check_recorder(settings: RecorderSettings) -> str:
    """A folder for recordings, which may not exist yet."""
    if not settings.folder:
        raise InputError(f"trigger_class {settings.trigger_class!r} has no effect: set [recorder] folder, too")
    folder = Path(settings.folder).absolute()
    around = (folder, *folder.parents)
    if any(map(_is_made_by_systemd, around)):
        return f"{folder}; systemd creates its folder"
    existing = next(each for each in around if os.access(each, os.F_OK))
    try:
        with tempfile.TemporaryDirectory(dir=existing):
            return settings.folder
    except OSError as error:
        raise _FolderError(f"can't write to {existing}: {error.strerror or error}", folder) from error


def _check_folder(path: Path, failure: str, access: int = 0) -> str:
    """What to say about a path at which something can be created. failure: start of the error. Raises InputError.

    access: to the folder, besides the right to create files in it.
    """
    folder = path.parent
    if _is_made_by_systemd(folder):
        return f"{path}; systemd creates its folder"
    if not os.access(folder, os.F_OK):
        raise _FolderError(f"{failure} {path}: there is no folder {folder}; create it, or choose another one", folder)
    if not os.access(folder, os.W_OK | os.X_OK | access):
        words = "read and write" if access else "write to"
        raise _FolderError(f"{failure} {path}: this user may not {words} {folder}; choose another folder", folder)
    return str(path)


def _is_made_by_systemd(folder: Path) -> bool:
    """Whether the service has this folder, although it may be missing or belong to another user before the start."""
    is_missing = not os.access(folder, os.F_OK)
    runtime = os.environ.get("RUNTIME_DIRECTORY", "").split(":")
    return str(folder) in _OF_SERVICE or (is_missing and str(folder) in runtime)
