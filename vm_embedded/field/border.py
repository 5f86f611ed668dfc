"""The border of the field: where it ends in each direction, and the convex polyline through these places.

Something that stands at the border hides it, so that the field seems to end nearer. A field is convex, therefore the
hull of all places bridges such gaps. Grass-like ground outside makes the field seem to end farther away. Therefore
hulls with fewer corners are tried, too, and the one that most places agree with is chosen. Reinhardt's
"Kalibrierungsfreie Bildverarbeitungsalgorithmen" (HTWK Leipzig, 2011) found the border in a similar way.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import Chosen, Floats, Mask
from .ground_points import GroundPoints, cross

_COLUMN = 0.04
"""Width of a column of points [rad]."""

_FEWEST = 2.0
"""A column shows the border only if so many points behind it are outside, and so many in front are of the field."""

_FEWEST_PLACES = 3
"""A border has at least so many places."""

_AGREES = 0.03
"""A place agrees with a border if they differ by less than this share of the distance, or by less than the mesh can
resolve."""

_ENOUGH = 0.95
"""A hull that this share of the places agrees with is good enough."""

_MOST_HULLS = 8
"""Largest number of hulls that are tried, each without a corner of the one before."""


def find_border(points: GroundPoints) -> Floats:
    """Corners (m, 2) [m] of the visible border, from right to left; none if the frame does not show it."""
    if not len(points.ranges):
        return np.empty((0, 2))
    places, ended = _ends_of_field(points)
    if np.count_nonzero(ended) < _FEWEST_PLACES:
        return np.empty((0, 2))
    limit = max(_AGREES, points.across / points.height)
    ranges = np.hypot(*places.T)
    left = np.arange(len(places))
    best, beyond, most = left[:0], ranges, -1
    for _ in range(_MOST_HULLS):
        at = _hull(places[left])
        if len(at) < 2:
            break
        corners = left[at]
        this = _beyond(places, corners)
        agreeing = np.count_nonzero(np.abs(this) < limit)
        if agreeing > most + 1:  # one place more may agree by chance; then the hull with more corners stays
            best, beyond, most = corners, this, agreeing
        if len(left) <= _FEWEST_PLACES or most > _ENOUGH * len(places):
            break
        left = np.delete(left, _farthest(ranges[left], at))
    return _part_that_ends(best, places, ended, beyond, limit)


def _ends_of_field(points: GroundPoints) -> tuple[Floats, Mask]:
    """The farthest place of the field (c, 2) [m] in each column of points, from right to left, and whether something
    else begins there (c,); otherwise the field may go on where the frame or the mesh ends.

    In each column, the place parts points of the field from points outside best: for points with the values 1, 1, -1
    and -1, from near to far, it is behind the second one.
    """
    columns = ((points.azimuths + np.pi) * (1.0 / _COLUMN)).astype(np.int16)
    order = np.argsort(columns, kind="stable")  # from near to far in each column, as the points are
    inside = sum((points.classes[name] for name in ("field", "line") if name in points.classes), np.float32(0.0))
    values = (inside - points.outside)[order]
    sums = np.cumsum(values, dtype=np.float64)
    starts = np.flatnonzero(np.diff(columns[order], prepend=-1))
    final = np.append(starts[1:], len(sums)) - 1
    best = np.maximum.reduceat(sums, starts)
    at_best = np.flatnonzero(sums == np.repeat(best, final + 1 - starts))
    seen = best - (sums[starts] - values[starts]) >= _FEWEST
    final, best = final[seen], best[seen]
    last = at_best[np.searchsorted(at_best, final, side="right") - 1]
    far = 0.5 * (points.ranges[order[last]] + points.ranges[order[np.minimum(last + 1, final)]])
    azimuths = (columns[order[final]] + 0.5) * _COLUMN - np.pi
    return points.directions(azimuths) * far[:, None], best - sums[final] >= _FEWEST


def _hull(places: Floats) -> Chosen:
    """Numbers of the places that are corners of their hull, from right to left.

    The point below the camera closes the hull, so only corners away from the camera are left.
    """
    around = np.zeros((len(places) + 1, 2), np.float32)
    around[:-1] = places
    numbers = cv2.convexHull(around, returnPoints=False, clockwise=False).ravel()
    return np.sort(numbers[numbers < len(places)])


def _beyond(places: Floats, corners: Chosen) -> Floats:
    """How far places (c, 2) are beyond the polyline through at least two of them, as a share of its distance there."""
    a, along = places[corners[:-1]], np.diff(places[corners], axis=0)
    # The ray t * place meets the line through a piece where the cross product of (t * place - a) and `along` is zero.
    lines = along[:, ::-1] * (1.0, -1.0) / cross(a, along)[:, None]
    return np.asarray((places * lines[_pieces(len(places), corners)]).sum(axis=1) - 1.0)


def _pieces(count: int, corners: Chosen) -> Chosen:
    """The piece of a polyline through some of `count` places that is in the direction of each."""
    inner = np.zeros(count, dtype=np.intp)
    inner[corners[1:-1]] = 1
    return np.cumsum(inner)


def _farthest(ranges: Floats, corners: Chosen) -> int:
    """The corner that is farthest beyond the places beside it. ranges (c,) [m]: of the places."""
    beside = ranges[np.maximum(corners - 1, 0)] + ranges[np.minimum(corners + 1, len(ranges) - 1)]
    return int(corners[np.argmax(ranges[corners] / beside)])


def _part_that_ends(corners: Chosen, places: Floats, ended: Mask, beyond: Floats, limit: float) -> Floats:
    """The longest part of a polyline along which the field ends, by the number of places that agree with it.

    beyond (c,): see _beyond.
    """
    if len(corners) < 2:
        return np.empty((0, 2))
    agrees = ended & (np.abs(beyond) < limit)
    up_to = np.append(0, np.cumsum(agrees))  # how many places agree before each
    agreeing = up_to[corners[1:] + 1] - up_to[corners[:-1]]
    both = ended[corners[1:]] & ended[corners[:-1]]
    kept = both | (agreeing > 0.5 * (corners[1:] - corners[:-1] + 1))
    run = np.cumsum(np.diff(kept, prepend=False))
    support = np.bincount(run, np.where(kept, agreeing, 0))
    longest = int(np.argmax(support))
    if support[longest] < _FEWEST_PLACES:
        return np.empty((0, 2))
    pieces = np.flatnonzero(run == longest)
    part = slice(pieces[0], pieces[-1] + 2)
    moved = _without_margin(places, corners, beyond, agrees)[part]
    outer = _hull(moved)  # each corner moved on its own, so some may point inward now
    return np.asarray(moved[outer] * (1.0 + _beyond(moved, outer).mean())) if len(outer) > 1 else moved[:0]


def _without_margin(places: Floats, corners: Chosen, beyond: Floats, agrees: Mask) -> Floats:
    """The corners moved from the outermost places to the middle of the places beside them.

    beyond (c,): see _beyond. agrees (c,): which places count.
    """
    piece = _pieces(len(places), corners)
    count = np.bincount(piece[agrees], minlength=len(corners) - 1)
    total = np.bincount(piece[agrees], beyond[agrees], minlength=len(corners) - 1)
    beside = np.convolve(total, [1.0, 1.0]) / np.maximum(np.convolve(count, [1.0, 1.0]), 1.0)
    return np.asarray(places[corners] * (1.0 + beside[:, None]))
