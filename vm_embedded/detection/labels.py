"""Labels in a picture: lines of text that do not cover each other."""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import Floats, Image, Mask
from ..borders.opencv_text import draw_text, text_size

Color = tuple[int, int, int]
"""Blue, green, red."""

INK: Color = (30, 30, 30)
OBJECT: Color = (60, 220, 255)

_SIDES = (
    *((1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, -1), (1, 1), (-1, 1)),
    *((0, -2), (0, 2), (1, -2), (-1, -2), (1, 2), (-1, 2), (0, -3), (0, 3)),
)
"""Where a label may be beside its place, best first: steps to the right and down, in sizes of the label."""


class Labels:
    """Writes labels into a BGR image (height, width, 3), each beside its place. scale: 1 for a picture of 1280 px.

    Write the most important labels first: a later one moves aside or is left out.
    """

    def __init__(self, canvas: Image, scale: float) -> None:
        self._canvas, self._scale = canvas, scale
        self._labels: list[tuple[float, ...]] = []  # boxes: left, top, right, bottom [px]
        self._marks: list[tuple[float, ...]] = []

    def avoid(self, place: Floats, radius: float) -> None:
        """Cover a mark at a place (2,) [px] only if there is no other room."""
        self._marks.append((*(place - radius).tolist(), *(place + radius).tolist()))

    def write(self, text: str, place: Floats, gap: float, color: Color, share: float = 1.0) -> None:
        """Write one line beside a place (2,) [px], at least `gap` [px] away. share: of the usual size of letters.

        The text is left out if it would cover other labels wherever it goes.
        """
        size, thickness = 0.6 * share * self._scale, max(1, round(1.5 * self._scale))
        width, height, base = text_size(text, size, thickness)
        pad = round(4 * self._scale)
        box = np.array([width + 2 * pad, height + base + pad])
        wanted = place + np.array(_SIDES) * (gap + 2 * pad + box / 2) - box / 2
        corners = np.rint(np.clip(wanted, 0, np.maximum(np.array(self._canvas.shape[1::-1]) - box, 0)))
        # A label that the edge of the image pushes back may cover its place.
        worse = (np.abs(corners - wanted).max(axis=1) > 1.0) | _overlap(corners, box, self._marks)
        free = np.flatnonzero(~_overlap(corners, box, self._labels))
        if not len(free):
            return
        left, top = corners[free[np.argmin(worse[free])]].astype(int).tolist()
        right, bottom = left + int(box[0]), top + int(box[1])
        self._labels.append((left, top, right, bottom))
        cv2.rectangle(self._canvas, (left, top), (right, bottom), INK, cv2.FILLED)
        draw_text(self._canvas, text, (left + pad, bottom - base), size, color, thickness)


def _overlap(corners: Floats, size: Floats, boxes: list[tuple[float, ...]]) -> Mask:
    """Whether boxes of a size (2,), with their top left corners at (n, 2), overlap any of the others; (n,)."""
    if not boxes:
        return np.zeros(len(corners), dtype=bool)
    others = np.array(boxes)
    apart = (corners[:, None] >= others[:, 2:]) | (corners[:, None] + size <= others[:, :2])
    return np.asarray((~np.asarray(apart.any(axis=2))).any(axis=1))
