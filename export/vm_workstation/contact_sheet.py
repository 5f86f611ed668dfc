"""Parts of a contact sheet: its pictures, its text and legend, and its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Image
from vm_embedded.borders.opencv_text import draw_text, text_size
from vm_embedded.errors import InputError
from vm_embedded.files import write_file

Color = tuple[int, int, int]
"""8-bit color in the order that a function's description gives."""

GAP, LINE = 6, 16
"""Distance between cells and height of a line of text [px]."""

PAPER, INK, FAINT_INK = (32, 32, 32), (235, 235, 235), (160, 160, 160)
"""Gray levels of the background and of text, BGR."""

_LARGEST = 65500  # [px], the largest width or height of a JPEG


def choose_indices(indices: Sequence[int], count: int, first: int | None = None, seed: int | None = None) -> list[int]:
    """At most `count` of the sorted indices: from `first` on, at random with a seed, or else evenly spaced."""
    if first is not None:
        return [index for index in indices if index >= first][:count]
    count = min(count, len(indices))
    if seed is not None:
        return sorted(int(each) for each in np.random.default_rng(seed).choice(indices, count, replace=False))
    return [indices[round(place)] for place in np.linspace(0, len(indices) - 1, count)]


def scaled_pixels(pixels: Floats, corner: tuple[float, float], scale: float) -> Floats:
    """Where pixels (n, 2) of a picture lie in a scaled cutout (n, 2) [px].

    corner: (x, y) of the cutout's upper left corner, the outer edge of its first pixel. Pixel centers are integers.
    """
    return np.asarray((pixels + 0.5 - np.array(corner)) * scale - 0.5)


def write_text(canvas: Image, text: str, at: tuple[int, int], color: Color) -> int:
    """Write text (BGR color) to the right of its lower left corner (x, y); return its width [px].

    Text that is too long for the canvas ends in two dots.
    """
    size, room = 0.4, canvas.shape[1] - at[0]
    text = text[: max(room, 2)]  # a letter has at least one pixel
    while len(text) > 2 and text_size(text, size)[0] > room:
        text = text.removesuffix("..")[:-1] + ".."
    draw_text(canvas, text, at, size, color)
    return text_size(text, size)[0]


def draw_legend(canvas: Image, colors: Mapping[str, Color], at: tuple[int, int]) -> None:
    """Draw a square of each RGB color with its name, in one line to the right of the lower left corner (x, y)."""
    x, y = at
    for name, color in colors.items():
        cv2.rectangle(canvas, (x, y - 9), (x + 9, y), color[::-1], cv2.FILLED)
        x += 14 + write_text(canvas, name, (x + 14, y), FAINT_INK) + 2 * GAP


def check_sheet_path(path: Path) -> None:
    """Raise InputError unless the file is a .jpg or a .png."""
    if path.suffix.lower() not in (".jpg", ".jpeg", ".png"):
        raise InputError(f"can't write {path}: the file of a contact sheet must be a .jpg or a .png")


def check_sheet_size(width: int, height: int) -> None:
    """Raise InputError if a sheet of this size [px] is too large for a JPEG."""
    if max(width, height) > _LARGEST:
        raise InputError(
            f"a contact sheet of {width} x {height} px is too large; the limit is {_LARGEST} px: "
            "show fewer pictures or smaller ones"
        )


def write_sheet(path: Path, sheet: Image) -> None:
    """Write a sheet (h, w, 3) BGR to a .jpg or .png.

    Raises InputError for another suffix, a sheet that is too large, or if the file can't be written.
    """
    check_sheet_path(path)
    check_sheet_size(sheet.shape[1], sheet.shape[0])
    write_file(path, cv2.imencode(path.suffix.lower(), sheet)[1].tobytes())
