"""A frame and its halved copies."""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import Image
from .pixel_formats import rgb_channels


class Pyramid:
    """A frame with its halved copies, each made when it is first needed.

    image: as `checked_image` returns it for `format`. channels: positions of red, green and blue in every level.
    """

    def __init__(self, image: Image, format: str) -> None:
        frame, self.channels = rgb_channels(image, format)
        self._levels = [frame]

    def level(self, number: int) -> Image:
        """The frame halved so many times; the mean of four pixels becomes one."""
        while len(self._levels) <= number:
            self._levels.append(_halved(self._levels[-1]))
        return self._levels[number]

    def bgr(self) -> Image:
        """The frame as BGR (height, width, 3), or gray (height, width)."""
        frame = self._levels[0]
        return frame if frame.ndim == 2 else frame[:, :, self.channels[::-1]]


def _halved(image: Image) -> Image:
    """A picture of half the width and height, without the last row or column of an odd number."""
    height, width = (max(side // 2, 1) for side in image.shape[:2])
    even = image[: 2 * height, : 2 * width]
    return np.asarray(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
