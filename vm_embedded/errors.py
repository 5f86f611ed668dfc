"""The one error that this project raises for what a user can mend."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class VisualMeshError(Exception):
    """Base of every error raised on purpose; its text is one line, fit for a terminal."""


class GeometryError(VisualMeshError):
    """A camera, plane or object that has no Visual Mesh."""


class InputError(VisualMeshError):
    """A frame, file or option that can't be used."""


class ModelError(VisualMeshError):
    """A model file that can't be trusted or run."""


def one_line(error: BaseException) -> str:
    """Another library's error as one line of at most 200 characters."""
    return (" ".join(str(error).split()) or type(error).__name__)[:200]


def unknown(what: str, value: object, allowed: Iterable[str]) -> str:
    """Say which value is not known, what is allowed, and the nearest right one."""
    names = list(allowed)
    near = get_close_matches(str(value).lower(), names, n=1, cutoff=0.5)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"unknown {what} {value!r}{hint} (allowed: {', '.join(names)})"
