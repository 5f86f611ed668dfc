"""Windows of pictures: a training that looks at parts learns as much from fewer points.

Most of a picture is lawn. A window of half its width and height has a quarter of its points, and if most windows
are put over an object, several times as many objects are seen in the same time. To the network it is the picture of a
smaller camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vm_embedded.lens import Lens, RadialLens, Size
from vm_embedded.lens_opencv import CalibratedLens

from .pictures import Picture

AIMED = 0.75
"""Share of the windows that show a pixel of an object, where the picture has one."""


def window_of(picture: Picture, share: float, objects: Sequence[int], random: np.random.Generator) -> Picture:
    """A window of a picture, of a share of its width and height; the same object if the share is 1.

    objects: positions of the classes that most windows are put over.
    """
    if share >= 1.0:
        return picture
    rows, columns = picture.labels.shape
    height, width = max(round(share * rows), 1), max(round(share * columns), 1)
    aim, place, down, right = random.random(4).tolist()
    shown = np.flatnonzero(np.isin(picture.labels, objects)) if aim < AIMED else np.empty(0, dtype=np.intp)
    lowest, highest = (0, 0), (rows - height, columns - width)
    if len(shown):
        y, x = divmod(int(shown[int(place * len(shown))]), columns)
        lowest = max(y - height + 1, 0), max(x - width + 1, 0)
        highest = min(y, highest[0]), min(x, highest[1])
    top = lowest[0] + int(down * (highest[0] - lowest[0] + 1))
    left = lowest[1] + int(right * (highest[1] - lowest[1] + 1))
    part = slice(top, top + height), slice(left, left + width)
    lens = _seen_through(picture.lens.lens, (columns, rows), (left, top), (width, height))
    image = np.ascontiguousarray(picture.image[part])
    return replace(picture, image=image, labels=picture.labels[part], lens=replace(picture.lens, lens=lens))


def _seen_through(lens: Lens, size: Size, corner: tuple[int, int], window: Size) -> Lens:
    """The lens for a window of a picture, whose corner (x, y) [px] is there."""
    fitted = lens.for_image(size)
    if isinstance(fitted, RadialLens):
        # From the window's center, not the picture's.
        x, y = (at + (part - whole) / 2.0 for at, part, whole in zip(corner, window, size, strict=True))
        return replace(fitted, center=(fitted.center[0] + x, fitted.center[1] + y), size=None)
    assert isinstance(fitted, CalibratedLens)
    x, y = (axis - at for axis, at in zip(fitted.optical_center, corner, strict=True))
    return replace(fitted, optical_center=(x, y), size=window)
