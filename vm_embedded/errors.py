"""The errors of this project, and functions for their messages."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from .borders.credentials import without_credentials
from .borders.text import printable

_MOST_START, _MOST_END = 1500, 500
"""Longest start and end of a message [characters]; what is between them is left out."""


class VisualMeshError(Exception):
    """Base of all errors that a user can fix; the message is one line of text, of 2,000 characters and a few.

    Messages quote values from files and from the network, so what could end the line or control a terminal is escaped,
    passwords in addresses are hidden, and the middle of a long message is left out.
    """

    def __str__(self) -> str:
        text = without_credentials(super().__str__())
        if len(text) > _MOST_START + _MOST_END:
            text = f"{text[:_MOST_START]} ... {text[-_MOST_END:]}"
        return printable(text)


class GeometryError(VisualMeshError):
    """A camera pose or object for which no Visual Mesh exists."""


class InputError(VisualMeshError):
    """An unusable frame, file or option."""


class NetworkError(InputError):
    """An address that this machine can't use yet: its network may still be starting."""


class InUseError(InputError):
    """A socket or port at which another process listens."""


class ModelError(VisualMeshError):
    """A damaged or unusable model file."""


def one_line(error: BaseException) -> str:
    """The message of another library's error, as one line of at most 200 characters."""
    return (" ".join(without_credentials(str(error)).split()) or type(error).__name__)[:200]


def install_extra(extra: str) -> str:
    """Advice to install an extra of pyproject.toml, for the message about a missing package."""
    return f"run: pip install '.[{extra}]' in the folder of vm-embedded"


def not_installed(error: ImportError, extra: str) -> str:
    """Message for a package that is missing, with the extra of pyproject.toml that brings it."""
    missing = (error.name or str(error)).partition(".")[0]
    return f"{missing} is not installed; {install_extra(extra)}"


def unknown(what: str, value: object, allowed: Iterable[str]) -> str:
    """Message for an unknown value: the value, the nearest allowed one, and all allowed ones."""
    names = list(allowed)
    near = get_close_matches(str(value).lower(), names, n=1, cutoff=0.5)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"unknown {what} {value!r}{hint} (allowed: {', '.join(names)})"
