"""The token of the status page: a file that only the user of the daemon can read, so that it survives a restart."""

from __future__ import annotations

import os
import re
import secrets
import stat
from contextlib import suppress
from pathlib import Path

from ..files import read_regular, unused_name

TOKEN_FILE = "status-page-token"

_TOKEN = re.compile(rb"[A-Za-z0-9_-]{12,100}\n?")
_LARGEST = 1000  # of the file [bytes]


def kept_token() -> tuple[str, str]:
    """The token, and why the next start will have another one; "" if it is kept.

    It is in the state folder of the systemd unit, otherwise in that of the user. A new one replaces a file that others
    can read, or that holds no token.
    """
    token = secrets.token_urlsafe(9)
    try:
        path = _state_folder() / TOKEN_FILE
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        return _read(path) or _write(path, token), ""
    except (OSError, RuntimeError) as error:  # RuntimeError: the user has no home
        return token, f"can't keep the token: {error}"


def _state_folder() -> Path:
    """$STATE_DIRECTORY of systemd, $XDG_STATE_HOME/vm-detect, or ~/.local/state/vm-detect."""
    given = os.environ.get("STATE_DIRECTORY", "").partition(":")[0]
    if given:
        return Path(given)
    home = os.environ.get("XDG_STATE_HOME", "")
    return (Path(home) if home.startswith("/") else Path.home() / ".local" / "state") / "vm-detect"


def _read(path: Path) -> str:
    """The token in a file that only its owner can read; "" if there is none, and then no such file. Raises OSError."""
    try:
        status = path.lstat()
        private = stat.S_ISREG(status.st_mode) and status.st_uid == os.geteuid() and not status.st_mode & 0o077
        content = read_regular(path) if private and status.st_size <= _LARGEST else b""
    except FileNotFoundError:
        return ""
    if _TOKEN.fullmatch(content):
        return content.decode().strip()
    path.unlink()
    return ""


def _write(path: Path, token: str) -> str:
    """Write a token, and return it; if another daemon was faster, return that one's. Raises OSError."""
    part = unused_name(path)
    descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        with os.fdopen(descriptor, "w") as file:
            file.write(f"{token}\n")
            file.flush()
            os.fsync(file.fileno())
        with suppress(FileExistsError):
            os.link(part, path)
            return token
    finally:
        part.unlink(missing_ok=True)
    return _read(path) or token
