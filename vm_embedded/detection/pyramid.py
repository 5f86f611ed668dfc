"""A frame and its halved copies.

To halve a whole frame takes as long as a third of a small network. So nothing is halved that only leads to a smaller
copy: the one of a quarter of the width is made from the frame itself. Each of its pixels is the mean of the four pixels
in the middle of sixteen.
"""

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
        self._levels = {0: frame}

    def level(self, number: int) -> Image:
        """The frame halved so many times."""
        if number not in self._levels:
            self._levels[number] = _smaller(self._levels[0], 4) if number == 2 else _smaller(self.level(number - 1), 2)
        return self._levels[number]

    def bgr(self) -> Image:
        """The frame as BGR (height, width, 3), or gray (height, width)."""
        frame = self._levels[0]
        return frame if frame.ndim == 2 else frame[:, :, self.channels[::-1]]


def _smaller(image: Image, times: int) -> Image:
    """A picture with 1 / times of the width and height, an even number, without the last rows and columns that are left
    over. A pixel is the mean of the four pixels in the middle of those that it replaces."""
    height, width = (max(side // times, 1) for side in image.shape[:2])
    whole = image[: times * height, : times * width]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
