"""A frame and its halved copies.

To halve a whole frame takes as long as a third of a small network. So nothing is halved that only leads to a smaller
copy: the one of a quarter of the width is made from the frame itself, and each of its pixels is the mean of the four
pixels in the middle of sixteen. The largest copy shows the mesh far away, in a narrow band of the frame: only what is
read of it is made.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import Image, Mask, Singles
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

    def at(self, number: int, x: Singles, y: Singles, counted: Mask | None = None) -> Image:
        """The colors (n, m[, channels]) at pixels x, y (n, m) of the frame halved so many times.

        They are linear between pixels; outside of the frame, its border is repeated. counted (n, m): the others, and
        NaN, may get any color.
        """
        if number != 1 or 1 in self._levels:
            return _remapped(self.level(number), x, y)
        frame = self._levels[0]
        (top, bottom), (left, right) = (
            _needed(places if counted is None else places[counted], max(side // 2, 1))
            for places, side in zip((y, x), frame.shape, strict=False)
        )
        part = _smaller(frame[2 * top : 2 * bottom, 2 * left : 2 * right], 2)
        return _remapped(part, x - np.float32(left), y - np.float32(top))

    def bgr(self) -> Image:
        """The frame as BGR (height, width, 3), or gray (height, width)."""
        frame = self._levels[0]
        return frame if frame.ndim == 2 else frame[:, :, self.channels[::-1]]


def _needed(places: Singles, size: int) -> tuple[int, int]:
    """The first of `size` pixels in a row that colors at these places depend on, and the one behind the last."""
    low, high = np.fmin.reduce(places, axis=None, initial=size), np.fmax.reduce(places, axis=None, initial=-1.0)
    first, last = (int(min(max(each, 0.0), size - 1.0)) for each in (low, high))
    return min(first, last), min(last + 2, size)


def _remapped(picture: Image, x: Singles, y: Singles) -> Image:
    colors = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(colors, dtype=np.uint8)


def _smaller(image: Image, times: int) -> Image:
    """A picture with 1 / times of the width and height, an even number, without the last rows and columns that are left
    over. A pixel is the mean of the four pixels in the middle of those that it replaces."""
    height, width = (max(side // times, 1) for side in image.shape[:2])
    whole = image[: times * height, : times * width]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
