"""Users and passwords in the addresses of cameras: no message, event or file shows them."""

from __future__ import annotations

import re
from urllib.parse import urlsplit

_HIDDEN = "***"

_USER = re.compile(r"\b([a-z][a-z0-9+.-]*:/+)(\S*)@", re.IGNORECASE)
"""The start of an address, and what may be its user and password. They may have characters that URLs do not allow."""

_SECRET = re.compile(
    r"([?&;/_\s](?:[\w.-]*(?:pass|pwd|pw|token|secret|key|auth|sign|cred|session|user|usr|login|account)[\w.-]*|u|p)=)"
    r"(\"[^\"]*\"|'[^']*'|[^&;\s\"']+)",
    re.IGNORECASE,
)
"""A value in a query, a path or a pipeline of GStreamer that may be a secret, and its name."""

HINT = "write the characters / ? # @ : % in user and password as %2F %3F %23 %40 %3A %25"
"""How to write a password in an address."""


def without_credentials(text: str) -> str:
    """A text without the users, passwords and tokens of the addresses in it."""
    if ":/" not in text and "gstreamer:" not in text:
        return text
    return _SECRET.sub(rf"\1{_HIDDEN}", _USER.sub(_without_user, text))


def _without_user(start: re.Match[str]) -> str:
    protocol, before = start.groups()
    host = re.split(r"[/?#]", before)[0]
    if before == _HIDDEN:
        return start[0]
    if host == before:
        return protocol
    # An @ behind the host is part of a path, or of a password with such characters.
    return f"{protocol}{_HIDDEN}@" if ":" in before or "@" in host else start[0]


def without_password(source: str) -> str:
    """The source of a camera to show in messages, without users, passwords and tokens.

    What stands before an @ may be a password wherever the address is mistyped.
    """
    if source.startswith("gstreamer:"):
        return without_credentials(source)
    shown = without_credentials(re.sub(r"\s", "%20", source) if "@" in source else source)
    before, at, behind = shown.rpartition("@")
    return f"{_HIDDEN}@{behind}" if at and ":" in before and not _USER.match(shown) else shown


def password_hint(source: str) -> str:
    """The end of a message about an address that does not work: how to write its password; empty if that is right.

    A password with a slash, a question mark or a number sign ends the host early.
    """
    try:
        address = urlsplit(source)
        is_right = "@" not in address.path + address.query + address.fragment and address.port != 0
    except ValueError:  # the port is no number, for example
        is_right = "@" not in source
    return "" if is_right else f"; {HINT}"
