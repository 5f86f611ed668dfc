"""Labels in a picture: lines of text that do not cover each other."""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import Floats, Image

Color = tuple[int, int, int]
"""Blue, green, red."""

INK: Color = (30, 30, 30)

_SIDES = ((1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, -1), (1, 1), (-1, 1), (0, -2), (0, 2), (1, -2), (-1, -2))
"""Where a label may be beside its place, best first: steps to the right and down, in sizes of the label."""


class Labels:
    """Writes labels into a BGR image (height, width, 3), each beside its place. scale: 1 for a picture of 1280 px.

    Write the most important labels first: a later one moves aside or is left out.
    """

    def __init__(self, canvas: Image, scale: float) -> None:
        self._canvas, self._scale = canvas, scale
        self._boxes: list[tuple[int, int, int, int]] = []

    def write(self, text: str, place: Floats, gap: float, color: Color, share: float = 1.0) -> None:
        """Write one line beside a place (2,) [px], at least `gap` [px] away. share: of the usual size of letters.

        The text is left out if it would cover other labels wherever it goes.
        """
        font, size, thickness = cv2.FONT_HERSHEY_SIMPLEX, 0.6 * share * self._scale, max(1, round(1.5 * self._scale))
        (width, height), base = cv2.getTextSize(text, font, size, thickness)
        pad = round(4 * self._scale)
        box = np.array([width + 2 * pad, height + base + pad])
        room = np.array(self._canvas.shape[1::-1]) - box
        for side in np.array(_SIDES):
            middle = place + side * (gap + 2 * pad + box / 2)
            x, y = np.rint(np.clip(middle - box / 2, 0, np.maximum(room, 0))).astype(int).tolist()
            if not self._overlaps(x, y, x + box[0], y + box[1]):
                break
        else:
            return
        right, bottom = int(x + box[0]), int(y + box[1])
        self._boxes.append((x, y, right, bottom))
        cv2.rectangle(self._canvas, (x, y), (right, bottom), INK, cv2.FILLED)
        cv2.putText(self._canvas, text, (x + pad, bottom - base), font, size, color, thickness, cv2.LINE_AA)

    def _overlaps(self, left: int, top: int, right: int, bottom: int) -> bool:
        return any(left < r and l < right and top < b and t < bottom for l, t, r, b in self._boxes)
