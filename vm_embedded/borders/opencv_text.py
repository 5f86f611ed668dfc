"""The one place that hands names and text to OpenCV, which takes UTF-8 only: other text ends the process (SIGSEGV)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2

from ..arrays import Image
from ..errors import InputError
from ..files import library_path
from .credentials import without_password

_LONGEST = 200
"""Most characters that are drawn; a picture has no room for more."""

_FONT = cv2.FONT_HERSHEY_SIMPLEX


def open_capture(source: int | str | Path, backend: int = cv2.CAP_ANY, *options: Sequence[int]) -> cv2.VideoCapture:
    """A video file or device by its path, a stream by its address or pipeline (str), or a camera by its number.

    backend, options: as for cv2.VideoCapture, which may not be open afterwards. A path is never a sequence of images.
    Raises InputError for an address that is not UTF-8, and OSError as `library_path` does.
    """
    if isinstance(source, int):
        return cv2.VideoCapture(source, backend, *options)
    if isinstance(source, str):
        check_address(source)
        return cv2.VideoCapture(source, backend, *options)
    backends = [each for each in cv2.videoio_registry.getStreamBackends() if each != cv2.CAP_IMAGES]
    with library_path(source) as name:
        for each in backends if backend == cv2.CAP_ANY else [backend]:
            capture = cv2.VideoCapture(name, each, *options)
            if capture.isOpened():
                break
    return capture


def check_address(source: str) -> None:
    """Raise InputError for the address of a stream, or a pipeline, that is not UTF-8 or has a zero byte."""
    shown = without_password(source)[:200]
    if "\0" in source:
        raise InputError(f"the address of a camera can't have a zero byte, as in {shown!r}")
    try:
        source.encode()
    except UnicodeEncodeError as error:
        raise InputError(f"the address of a camera must be UTF-8 text, not {shown!r}") from error


def open_writer(path: Path, codec: int, rate: float, size: tuple[int, int]) -> cv2.VideoWriter:
    """A video file to write, as for cv2.VideoWriter, which may not be open afterwards.

    The last part of `path` must be UTF-8 without a %, such as a name of `files.unused_name`: without its suffix, OpenCV
    does not know the format. Raises OSError as `library_path` does.
    """
    with library_path(path) as name:
        return cv2.VideoWriter(name, codec, rate, size)


def text_size(text: str, size: float, thickness: int = 1, font: int = _FONT) -> tuple[int, int, int]:
    """Width, height above the base line, and depth below it [px] of text that `draw_text` draws."""
    (width, height), base = cv2.getTextSize(_drawable(text), font, size, thickness)
    return width, height, base


def draw_text(
    canvas: Image,
    text: str,
    corner: tuple[int, int],
    size: float,
    color: Sequence[float] | float,
    thickness: int = 1,
    font: int = _FONT,
) -> None:
    """Draw one line of text to the right of its lower left corner (x, y) [px]. size: factor of the font's letters.

    Characters that can't be printed appear as "?", as do those that this OpenCV can't draw: OpenCV 4 draws ASCII only.
    """
    cv2.putText(canvas, _drawable(text), corner, font, size, color, thickness, cv2.LINE_AA)


def _drawable(text: str) -> str:
    """The text without anything that OpenCV can't take, and without more than anyone could read."""
    shown = text if len(text) <= _LONGEST else text[: _LONGEST - 2] + ".."
    return "".join(each if each.isprintable() else "?" for each in shown)
