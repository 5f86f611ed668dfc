"""True and found objects, and the overlaps of their pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from vm_embedded.arrays import Floats, Mask, Singles
from vm_embedded.geometry.lens import Size

_LINES = 8
"""Scan lines per row of pixels. Along a scan line, the share inside an outline is exact."""

Window = tuple[slice, slice]
"""Rows and columns of a picture."""


class FoundObject(Protocol):
    """A found object, for example a `vm_embedded.detection.detections.Detection`.

    confidence: 0 to 1. outline (m, 2) [px]: of the whole object, also outside the picture. position (3,) [m]: on the
    plane. bearing (3,): unit vector from the camera to its center.
    """

    @property
    def confidence(self) -> float: ...
    @property
    def outline(self) -> Floats: ...
    @property
    def position(self) -> Floats: ...
    @property
    def bearing(self) -> Floats: ...


@dataclass(frozen=True, eq=False)
class TrueObject:
    """A true object of a picture.

    mask (h, w): bool, or the share of each pixel that the object covers, 0 to 1. If known, it includes hidden parts
    inside the picture: with the visible part alone, the IoU of a correct outline could not exceed `visible`. position
    (3,) [m]: on the plane, in the same frame as found positions; NaN if unknown. radius [px]: of a disk with the area
    of the whole outline. visible: visible share of the outline. bearing (3,): unit vector from the camera to its
    center, in the frame of found bearings; NaN if unknown. angular_radius [rad]: NaN if unknown.
    """

    mask: Mask | Singles
    position: Floats
    radius: float
    visible: float = 1.0
    bearing: Floats = field(default_factory=lambda: np.full(3, np.nan))
    angular_radius: float = math.nan

    def is_ignored(self, min_visible: float, min_radius: float) -> bool:
        """Whether less than `min_visible` of it is visible, or its radius is below `min_radius` [px]."""
        return self.visible < min_visible or self.radius < min_radius

    def offsets(self, rays: Floats) -> Floats:
        """Angles (n,) between unit vectors (n, 3) and the ray to its center, over its angular radius.

        0 at the center, 1 at the outline of a ball; NaN if its bearing or angular radius is unknown.
        """
        chords = np.linalg.norm(rays - self.bearing, axis=1)
        return np.asarray(2.0 * np.arcsin(np.minimum(chords / 2.0, 1.0)) / self.angular_radius)


def coverage(outline: Floats, size: Size) -> tuple[Window, Floats]:
    """The part of the picture around a polygon (m, 2) [px], and the share (h, w) of each pixel inside the polygon.

    Corners that are not finite are ignored. Areas that a polygon surrounds twice count as outside.
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
        # Pixels right of the first crossing are inside, those right of the second are outside, and so on.
        for number in range(int(crosses.sum(axis=1).max(initial=0))):
            beyond = np.clip(columns + 0.5 - crossings[:, number, None], 0.0, 1.0)
            share += -beyond if number % 2 else beyond
    return (slice(int(top), int(bottom)), slice(int(left), int(right))), share / _LINES


@dataclass(frozen=True, eq=False)
class CommonAreas:
    """Areas (n, m) [px^2] inside the picture: of n found objects, of m true objects, and of both at once."""

    found: Floats
    true: Floats
    both: Floats

    @property
    def iou(self) -> Floats:
        """Intersection over union (n, m)."""
        return _over(self.both, self.found + self.true - self.both)

    @property
    def over_smaller(self) -> Floats:
        """Intersection over the smaller of the two areas (n, m)."""
        return _over(self.both, np.minimum(self.found, self.true))


def common_areas(truths: Sequence[TrueObject], found: Sequence[FoundObject]) -> CommonAreas:
    """The common areas of found and true objects.

    With a bool mask, a found object covers a pixel if at least half of the pixel is inside its outline; so the correct
    outline has an IoU of 1. With a mask of shares, the common share of a pixel is the smaller of both.
    """
    areas = CommonAreas(*np.zeros((3, len(found), len(truths))))
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
    """part / whole (n, m), 0 where whole is 0."""
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0.0)
