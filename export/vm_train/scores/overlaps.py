"""True and found objects, and how much they have in common: the pixels of outlines and masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vm_embedded.arrays import Floats, Mask, Singles
from vm_embedded.geometry.lens import Size

_LINES = 8
"""Scan lines per row of pixels, along which the share inside an outline is exact."""

Window = tuple[slice, slice]
"""Rows and columns of a picture."""


class Found(Protocol):
    """What is needed of a found object; `vm_embedded.detection.detections.Detection` is one.

    confidence. outline (m, 2) [px]: of the whole object, also beyond the picture. position (3,) [m]: on the plane.
    """

    @property
    def confidence(self) -> float: ...
    @property
    def outline(self) -> Floats: ...
    @property
    def position(self) -> Floats: ...


@dataclass(frozen=True, eq=False)
class TrueObject:
    """An object that is in a picture.

    mask (h, w): bool, or the share of each pixel that is the object's, 0 to 1. It is what shows of the object, or all
    of it inside the picture, where that is known: of what shows, an outline of the whole can't overlap more than
    `visible`. position (3,) [m]: on the plane, in the frame of what is found; NaN if not known. radius [px]: of a disk
    as large as its whole outline. visible: share of that outline that shows.
    """

    mask: Mask | Singles
    position: Floats
    radius: float
    visible: float = 1.0


def coverage(outline: Floats, size: Size) -> tuple[Window, Floats]:
    """A window of the picture that the polygon (m, 2) [px] lies in, and the share (h, w) of each of its pixels inside.

    Corners that are not finite are left out. Where the outline crosses itself, what it goes around twice is outside.
    """
    corners = outline[np.isfinite(outline).all(axis=1)]
    if len(corners) < 3:
        return (slice(0, 0), slice(0, 0)), np.zeros((0, 0))
    left, top = np.clip(np.rint(corners.min(axis=0)), 0, size).astype(int)
    right, bottom = np.clip(np.rint(corners.max(axis=0)) + 1, 0, size).astype(int)
    rows, columns = np.arange(top, bottom)[:, None], np.arange(left, right)
    share = np.zeros((len(rows), len(columns)))
    x, y = corners.T
    next_x, next_y = np.roll(corners, -1, axis=0).T
    for line in range(_LINES):
        height = rows + (line + 0.5) / _LINES - 0.5
        crosses = (y <= height) != (next_y <= height)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossings = np.where(crosses, x + (height - y) * ((next_x - x) / (next_y - y)), np.inf)
        crossings.sort(axis=1)
        # What is right of a crossing turns from outside to inside, and at the next one back.
        for number in range(int(crosses.sum(axis=1).max(initial=0))):
            beyond = np.clip(columns + 0.5 - crossings[:, number, None], 0.0, 1.0)
            share += -beyond if number % 2 else beyond
    return (slice(int(top), int(bottom)), slice(int(left), int(right))), share / _LINES


@dataclass(frozen=True, eq=False)
class Common:
    """Areas (n, m) [px^2] of n found and m true objects in the picture, and what they have in common."""

    found: Floats
    true: Floats
    both: Floats

    @property
    def of_union(self) -> Floats:
        """What they have in common over what either covers, IoU (n, m)."""
        return _over(self.both, self.found + self.true - self.both)

    @property
    def of_lesser(self) -> Floats:
        """What they have in common over the smaller of the two (n, m)."""
        return _over(self.both, np.minimum(self.found, self.true))


def common_areas(truths: Sequence[TrueObject], found: Sequence[Found]) -> Common:
    """What the found and the true objects have in common.

    With a mask of whole pixels, a pixel is the found one's if half of it or more is: a right outline then overlaps
    wholly. With one of shares, the common share of a pixel is the lesser of the two.
    """
    areas = Common(*np.zeros((3, len(found), len(truths))))
    if not truths:
        return areas
    height, width = truths[0].mask.shape
    true = [float(each.mask.sum(dtype=np.float64)) for each in truths]
    for row, each in enumerate(found):
        window, share = coverage(each.outline, (width, height))
        whole = (share >= 0.5).astype(np.float64)
        for column, truth in enumerate(truths):
            inside = whole if truth.mask.dtype == bool else share
            areas.found[row, column] = inside.sum()
            areas.true[row, column] = true[column]
            areas.both[row, column] = np.minimum(inside, truth.mask[window]).sum()
    return areas


def _over(part: Floats, whole: Floats) -> Floats:
    """part / whole (n, m), 0 where there is no whole."""
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0.0)
