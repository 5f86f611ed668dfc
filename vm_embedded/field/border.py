"""The border of the field: where it ends in each direction, and the convex polyline through these places.

Something that stands at the border hides it, so that the field seems to end nearer. A field is convex, therefore the
hull of all places bridges such gaps. Grass-like ground outside makes the field seem to end farther away. Therefore
hulls with fewer corners are tried, too, and the one that most places agree with is chosen. Reinhardt's
"Kalibrierungsfreie Bildverarbeitungsalgorithmen" (HTWK Leipzig, 2011) found the border in a similar way.

There are few places, and a hull changes only near a corner that is gone. So this works on lists of complex numbers: of
conj(a) b, the imaginary part is the cross product of a and b.
"""

from __future__ import annotations

import sys
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from itertools import accumulate, groupby, islice, pairwise
from operator import itemgetter

import numpy as np

from ..arrays import Floats
from .ground_points import GroundPoints

_FEWEST = 2.0
"""A column shows the border only if so many points behind it are outside, and so many in front are of the field."""

_AGREES = 0.03
"""A place agrees with a border if they differ by less than this share of the distance, or by less than the mesh can
resolve."""

_ENOUGH = 0.9
"""A hull that this share of the places agrees with is good enough."""

_MOST_HULLS = 8
"""Largest number of hulls that are tried, each without a corner of the one before."""

Hull = tuple[list[int], list[float]]
"""Numbers of the places that are corners, from right to left, and how far each place is beyond the polyline through
them, as a share of its distance there."""


def find_border(points: GroundPoints) -> Floats:
    """Corners (m, 2) [m] of the visible border, from right to left; none if the frame does not show it."""
    places, ended = _ends_of_field(points)
    if sum(ended) < 3:
        return np.empty((0, 2))
    limit = max(_AGREES, points.across / points.height)
    best: Hull = [], []
    most = -2
    for hull in islice(_hulls(places), _MOST_HULLS):
        agreeing = sum([-limit < each < limit for each in hull[1]])
        if agreeing > most + 1:  # one place more may agree by chance; then the hull with more corners stays
            best, most = hull, agreeing
            if most > _ENOUGH * len(places):
                break
    border = np.array(_part_that_ends(places, ended, best, limit), dtype=np.complex128)
    return border.view(np.float64).reshape(-1, 2)


def _ends_of_field(points: GroundPoints) -> tuple[list[complex], list[bool]]:
    """The farthest place of the field [m] in each column of points, from right to left, and whether something else
    begins there; otherwise the field may go on where the frame or the mesh ends.

    In each column, the place parts points of the field from points outside best: for points with the values 1, 1, -1
    and -1, from near to far, it is behind the second one.
    """
    ground = points.map
    shown = points.shown.take(ground.by_column).nonzero()[0]
    if points.inside is None or not len(shown):
        return [], []
    values = points.inside.take(ground.by_column.take(shown))
    values[np.isnan(values)] = 0.0  # one NaN would spoil the sums of all others
    sums = np.cumsum(values, dtype=np.float64)
    bounds = np.searchsorted(shown, ground.bounds)
    counts = bounds[1:] - bounds[:-1]
    columns = np.flatnonzero(counts)
    counts, starts = counts[columns], bounds[columns]
    final = starts + counts - 1
    best = np.maximum.reduceat(sums, starts)
    at_best = np.flatnonzero(sums == np.repeat(best, counts))
    last = at_best[np.searchsorted(at_best, final, side="right") - 1]
    seen = np.flatnonzero(best - sums[starts] + values[starts] >= _FEWEST)
    far = ground.column_ranges[shown[np.array([last, np.minimum(last + 1, final)])[:, seen]]].sum(axis=0)
    turn = 0.5 * points.height * complex(*points.heading[:, 0].tolist())
    return (
        (far * ground.directions[columns[seen]] * turn).tolist(),
        (best - sums[final] >= _FEWEST)[seen].tolist(),
    )


def _hulls(places: Sequence[complex]) -> Iterator[Hull]:
    """The hull of places from right to left, and others, each without a corner of the one before: the one that is
    farthest beyond the places beside it."""
    left, ranges = list(range(len(places))), list(map(abs, places))

    def outward(corner: int) -> float:
        at = bisect_left(left, corner)
        return ranges[at] / (ranges[max(at - 1, 0)] + ranges[min(at + 1, len(left) - 1)])

    corners = _hull(places, left)
    peaks, beyond = list(map(outward, corners)), _beyond(places, corners)
    yield corners, beyond
    while len(left) > 3:
        at = peaks.index(max(peaks))
        gone = bisect_left(left, corners[at])
        del left[gone], ranges[gone]
        start = bisect_left(left, corners[at - 1]) if at else 0
        end = bisect_left(left, corners[at + 1]) + 1 if at + 1 < len(corners) else len(left)
        between = _hull(
            places, left[start:end]
        )  # the hull changes only between the corners beside the one that is gone
        before = max(at - 1, 0)
        corners = corners[:before] + between + corners[at + 2 :]
        peaks[before : at + 2] = map(outward, between)
        beyond = _beyond(places, corners, beyond, max(before - 1, 0), before + len(between))
        yield corners, beyond


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


def _beyond(
    places: Sequence[complex],
    corners: Sequence[int],
    known: Sequence[float] = (),
    first: int = 0,
    end: int = sys.maxsize,
) -> list[float]:
    """How far places are beyond the polyline through at least two of them, as a share of their distance there.

    known: the result for a polyline that differs from this one only in the pieces from number `first` up to `end`.
    """
    beyond = list(known) or [0.0] * len(places)
    edges = [0, *corners[1:-1], len(places)]  # the first and the last piece go on
    for number in range(first, min(end, len(edges) - 1)):
        place = places[corners[number]]
        along = places[corners[number + 1]] - place
        # The ray t * place meets the line through a piece where (t * place - start) x along is 0.
        line = along / ((place.conjugate() * along).imag or 1e-9)
        span = slice(edges[number], edges[number + 1])
        beyond[span] = [(each.conjugate() * line).imag - 1.0 for each in places[span]]
    return beyond


def _part_that_ends(places: Sequence[complex], ended: Sequence[bool], hull: Hull, limit: float) -> list[complex]:
    """The longest part of a polyline along which the field ends, by the number of places that agree with it."""
    corners, beyond = hull
    agrees = [end and -limit < each < limit for end, each in zip(ended, beyond, strict=True)]
    count = list(accumulate(agrees, initial=0))  # how many places agree before each
    support = [
        (count[last + 1] - count[first], ended[first] and ended[last], last + 1 - first)
        for first, last in pairwise(corners)
    ]
    kept = [is_sure or agreeing > 0.5 * length for agreeing, is_sure, length in support]
    runs = [list(run) for is_kept, run in groupby(range(len(kept)), kept.__getitem__) if is_kept]
    agreeing, longest = max(
        ((sum(support[each][0] for each in run), run) for run in runs), key=itemgetter(0), default=(0, [])
    )
    if agreeing < 3:
        return []
    # The corners move from the outermost places to the middle of the places beside them.
    total = list(accumulate([each if agree else 0.0 for each, agree in zip(beyond, agrees, strict=True)], initial=0.0))
    edges = [0, 0, *corners[1:-1], len(places), len(places)]
    moved = []
    for number in range(longest[0], longest[-1] + 2):
        first, last = edges[number], edges[number + 2]
        moved.append(
            places[corners[number]] * (1.0 + (total[last] - total[first]) / max(count[last] - count[first], 1))
        )
    outer = _hull(moved, range(len(moved)))  # each corner moved on its own, so some may point inward now
    larger = 1.0 + sum(_beyond(moved, outer)) / len(moved)
    return [moved[each] * larger for each in outer]
