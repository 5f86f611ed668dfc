"""The border of the field: where it ends in each direction, and the convex polyline through these places.

Something that stands at the border hides it, so that the field seems to end nearer. A field is convex, therefore the
hull of all places bridges such gaps. Grass-like ground outside makes the field seem to end farther away. Therefore
hulls with fewer corners are tried, too, and the one that most places agree with is chosen. Reinhardt's
"Kalibrierungsfreie Bildverarbeitungsalgorithmen" (HTWK Leipzig, 2011) found the border in a similar way.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from itertools import islice, pairwise

import numpy as np

from ..arrays import Chosen, Floats, Mask
from .ground_points import GroundPoints, starts_of_runs

_COLUMN = 0.04
"""Width of a column of points [rad]."""

_FEWEST = 2.0
"""A column shows the border only if so many points behind it are outside, and so many in front are of the field."""

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
    if np.count_nonzero(ended) < 3:
        return np.empty((0, 2))
    limit = max(_AGREES, points.across / points.height)
    hulls = list(islice(_hulls(places), _MOST_HULLS))
    beyond = _beyond(places, hulls)
    agreeing = np.count_nonzero(np.abs(beyond) < limit, axis=1).tolist()
    best = 0
    for number, count in enumerate(agreeing):
        if agreeing[best] > _ENOUGH * len(places):
            break
        if count > agreeing[best] + 1:  # one place more may agree by chance; then the hull with more corners stays
            best = number
    return _part_that_ends(np.array(hulls[best]), places, ended, beyond[best], limit)


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
    starts = starts_of_runs(columns[order])
    final = np.append(starts[1:], len(sums)) - 1
    best = np.maximum.reduceat(sums, starts)
    at_best = np.flatnonzero(sums == np.repeat(best, final + 1 - starts))
    seen = best - (sums[starts] - values[starts]) >= _FEWEST
    final, best = final[seen], best[seen]
    last = at_best[np.searchsorted(at_best, final, side="right") - 1]
    far = 0.5 * (points.ranges[order[last]] + points.ranges[order[np.minimum(last + 1, final)]])
    azimuths = (columns[order[final]] + 0.5) * _COLUMN - np.pi
    return points.directions(azimuths) * far[:, None], best - sums[final] >= _FEWEST


def _hulls(places: Floats) -> Iterator[list[int]]:
    """The hull of places (c, 2) from right to left, and others, each without a corner of the one before: the one that
    is farthest beyond the places beside it."""
    numbers = list(map(complex, *places.T.tolist()))
    left, ranges = list(range(len(places))), list(map(abs, numbers))
    corners = _hull(numbers, left)
    yield corners
    while len(left) > 3:
        sides = [ranges[0], *ranges, ranges[-1]]
        where = [bisect_left(left, corner) for corner in corners]
        beyond = [ranges[each] / (sides[each] + sides[each + 2]) for each in where]
        at = beyond.index(max(beyond))
        del left[where[at]], ranges[where[at]]
        edges = [0, *where, len(places)]  # the hull changes only between the corners beside the one that is gone
        between = _hull(numbers, left[edges[at] : edges[at + 2]])
        corners = [*corners[: max(at - 1, 0)], *between, *corners[at + 2 :]]
        yield corners


def _hull(places: Sequence[complex], numbers: Sequence[int]) -> list[int]:
    """Those numbers of places, from right to left, that are corners of their hull.

    The point below the camera closes the hull, so only corners away from the camera are left.
    """
    corners: list[int] = []
    for number in numbers:
        while len(corners) > 1:
            before, corner = places[corners[-2]], places[corners[-1]]
            if ((corner - before).conjugate() * (places[number] - corner)).imag > 0.0:  # it turns left there
                break
            corners.pop()
        corners.append(number)
    return corners


def _beyond(places: Floats, hulls: Sequence[Sequence[int]]) -> Floats:
    """How far places (c, 2) are beyond polylines through at least two of them, as a share of their distance there.

    hulls: numbers of the corners of h polylines. Returns the shares (h, c).
    """
    first, last = np.array([piece for corners in hulls for piece in pairwise(corners)]).T
    (x, y), (along_x, along_y) = places[first].T, (places[last] - places[first]).T
    # The ray t * place meets the line through a piece where (t * place - start) x along is 0.
    lines = np.array([along_y, -along_x]) / (x * along_y - y * along_x)
    counts = [count for corners in hulls for count in _counts(len(places), corners)]
    x, y = np.repeat(lines, counts, axis=1).reshape(2, len(hulls), -1)
    return np.asarray(x * places[:, 0] + y * places[:, 1] - 1.0)


def _counts(count: int, corners: Sequence[int]) -> list[int]:
    """How many of `count` places are in the direction of each piece of a polyline through some of them."""
    return [last - first for first, last in pairwise([0, *corners[1:-1], count])]


def _part_that_ends(corners: Chosen, places: Floats, ended: Mask, beyond: Floats, limit: float) -> Floats:
    """The longest part of a polyline along which the field ends, by the number of places that agree with it.

    beyond (c,): see _beyond.
    """
    agrees = ended & (np.abs(beyond) < limit)
    up_to = np.append(0, np.cumsum(agrees))  # how many places agree before each
    agreeing = up_to[corners[1:] + 1] - up_to[corners[:-1]]
    both = ended[corners[1:]] & ended[corners[:-1]]
    kept = both | (agreeing > 0.5 * (corners[1:] - corners[:-1] + 1))
    run = np.cumsum(np.append(kept[:1], kept[1:] != kept[:-1]))
    support = np.bincount(run, np.where(kept, agreeing, 0))
    longest = int(np.argmax(support))
    if support[longest] < 3:
        return np.empty((0, 2))
    pieces = np.flatnonzero(run == longest)
    part = slice(pieces[0], pieces[-1] + 2)
    moved = _without_margin(places, corners, beyond, agrees)[part]
    outer = next(_hulls(moved))  # each corner moved on its own, so some may point inward now
    return np.asarray(moved[outer] * (1.0 + _beyond(moved, [outer]).mean()))


def _without_margin(places: Floats, corners: Chosen, beyond: Floats, agrees: Mask) -> Floats:
    """The corners moved from the outermost places to the middle of the places beside them.

    beyond (c,): see _beyond. agrees (c,): which places count.
    """
    piece = np.repeat(np.arange(len(corners) - 1), _counts(len(places), corners.tolist()))
    count = np.bincount(piece, agrees)
    total = np.bincount(piece, np.where(agrees, beyond, 0.0))
    beside = np.append(total, 0.0) + np.append(0.0, total)
    beside /= np.maximum(np.append(count, 0.0) + np.append(0.0, count), 1.0)
    return np.asarray(places[corners] * (1.0 + beside[:, None]))
