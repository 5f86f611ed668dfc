"""Pictures for the page: a crop, cut out of its image with a margin and its box, or a whole image."""

from __future__ import annotations

import cv2
import numpy as np

from vm_embedded.arrays import Image
from vm_embedded.output.box_files import Shares

SIDE = 480
"""Width and height of a crop's picture [px]."""

_MARGIN = 2.0
"""Width of the surroundings on each side of a box, in the longer side of the box."""

_LEAST_SPAN = 48.0
"""Least width of what a crop shows [px of the image]."""

_WIDEST = 2400
"""Largest side of the picture of a whole image [px]. The page can enlarge it, to draw small boxes."""

_OUTSIDE = (128, 128, 128)
_LINE, _EDGE = (60, 220, 255), (30, 30, 30)
_QUALITY = 90


def cut(image: Image, shares: Shares) -> bytes:
    """A JPEG of SIDE x SIDE px with the box in the middle. What is outside of the image is gray.

    image: uint8 (height, width, 3), BGR. shares: center and size of the box, as shares of the image.
    """
    size = np.array(image.shape[1::-1])
    center, sides = np.array(shares[:2]) * size - 0.5, np.array(shares[2:]) * size
    scale = SIDE / max((1.0 + 2.0 * _MARGIN) * sides.max(), _LEAST_SPAN)
    if scale < 1.0:  # without this, thin structures of large crops would alias
        shrunk = np.maximum(np.rint(size * scale), 1.0)
        image = _resized(image, shrunk.astype(int).tolist())
        center, sides, scale = (center + 0.5) * shrunk / size - 0.5, sides * shrunk / size, 1.0
    shift = (SIDE - 1) / 2 - scale * center
    matrix = np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]]])
    warped = cv2.warpAffine(image, matrix, (SIDE, SIDE), flags=cv2.INTER_LINEAR, borderValue=_OUTSIDE)
    picture = np.asarray(warped, dtype=np.uint8)
    _draw_box(picture, np.full(2, (SIDE - 1) / 2), scale * sides + 3.0)
    return _jpeg(picture)


def whole(image: Image) -> bytes:
    """A JPEG of a whole image, BGR uint8 (height, width, 3); large images are made smaller."""
    scale = min(_WIDEST / max(image.shape[:2]), 1.0)
    size = [max(round(scale * each), 1) for each in image.shape[1::-1]]
    return _jpeg(_resized(image, size) if scale < 1.0 else image)


def _resized(image: Image, size: list[int]) -> Image:
    """A smaller image of a size (width, height) [px]."""
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _draw_box(picture: Image, center: np.ndarray, sides: np.ndarray) -> None:
    """Draw a box. Callers make it larger than the object, so that the line does not hide the object's edge."""
    corners = [[int(each) for each in np.rint(corner * 16)] for corner in (center - sides / 2, center + sides / 2)]
    for color, thickness in ((_EDGE, 4), (_LINE, 2)):
        cv2.rectangle(picture, corners[0], corners[1], color, thickness, cv2.LINE_AA, shift=4)


def _jpeg(picture: Image) -> bytes:
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
