"""Straight pieces of field lines among the points of the class line.

All lines of a field are parallel or at right angles, except for its circle. A Hough transform of the line points finds
the two directions. Lines in these directions are taken one after the other, best first, and fitted to their points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats, Mask, Singles
from .ground_points import GroundPoints, starts_of_runs

LEAST = 0.1
"""Points with a smaller probability of the class line suggest no line."""

_FARTHEST = 10.0
"""Farther points [m] are ignored: a line there is narrower than a pixel of most cameras."""

_ANGLES = 45
"""Directions that the Hough transform tries, from 0 to a right angle."""

_MOST_VOTERS = 200
"""Largest number of points that choose the direction."""

_BIN = 0.06
"""Width of a bin of the Hough transform [m], at the camera; it grows with the distance of the line."""

_STEP = 0.01
"""Distances of lines are rounded to this [m] to look up their bins."""

_MOST_LINES = 14
"""Largest number of lines, which may have several pieces."""

_SHORTEST = 0.2
"""Shorter pieces [m] are no lines."""

_FEWEST = 4
"""A line has at least so many points."""

_LEAST_VOTES = 1.4
"""Sum of the probabilities of the points that suggest a line, at least."""

_EXPECTED = 0.1
"""Probability from which a point speaks for a line that it is on; one with less speaks against it."""

_LEAST_SUPPORT = 0.6
"""Sum of what a piece's points have above that probability, at least."""

_MOST_AGAINST = 2.0
"""Points in a row that speak against a line divide it, if the sum of what they have below that probability is more."""

_TURN = 0.15
"""A fitted line turns by less than this [rad] from the expected direction."""

_ERROR = 0.014
"""Standard deviation [rad] of a line from the direction that the Hough transform finds: fields are painted, and poses
are measured, with errors."""

_NOISE = 0.5
"""Standard deviation of a point's distance from its line, as a share of its tolerance."""


def tolerance(outward: Floats, blur: Floats, across: float) -> Floats:
    """How far (...) [m] a point may be from a line's middle.

    outward (...): how much the line's normal points away from the camera, 0 to 1. blur (...), across [m]: as those of
    LinePoints.
    """
    return np.asarray(outward * (0.7 * (blur - across)) + (0.04 + 0.7 * across))


@dataclass(frozen=True, eq=False)
class LinePoints:
    """n points near enough for lines. positions (n, 2) [m]. weights (n,): their probabilities. ranges (n,) [m]: from
    below the camera. blur (n,) [m]: half the distance between rings of the mesh there. across [m]: half the distance
    between points of a ring."""

    positions: Floats
    weights: Singles
    ranges: Floats
    blur: Floats
    across: float

    def __len__(self) -> int:
        return len(self.ranges)

    def tolerance(self, offsets: Floats) -> Floats:
        """How far (..., n) [m] a point may be from a line's middle. offsets (..., n) [m]: how far the points are from
        the camera along the line's normal."""
        return tolerance(np.abs(offsets) / self.ranges, self.blur, self.across)

    def part(self, chosen: Chosen | slice) -> LinePoints:
        """Some of the points."""
        return LinePoints(
            self.positions[chosen], self.weights[chosen], self.ranges[chosen], self.blur[chosen], self.across
        )


@dataclass(frozen=True, eq=False)
class Piece:
    """A straight piece of a line: its ends (2, 2) [m], the numbers of its likely points, and its support: the sum of
    what all points on it have above the probability from which a point speaks for a line."""

    ends: Floats
    members: Chosen
    support: float

    @property
    def length(self) -> float:
        """Distance between the ends [m]."""
        return math.dist(*self.ends.tolist())


def line_points(points: GroundPoints) -> LinePoints:
    """All points near enough for lines, with the probability 0 if the network has no class line."""
    first, last = np.searchsorted(points.ranges, (1e-3, _FARTHEST))
    near = slice(int(first), int(last))
    ranges = points.ranges[near]
    probabilities = points.classes.get("line", np.zeros(len(points.ranges), np.float32))
    return LinePoints(
        points.positions[near], probabilities[near], ranges, 0.5 * points.along(ranges), 0.5 * points.across
    )


def find_pieces(points: LinePoints, likely: LinePoints) -> list[Piece]:
    """Straight pieces of lines, longest first.

    points: all points near enough for lines. likely: those of them with a probability above LEAST.
    """
    if len(likely) < _FEWEST:
        return []
    normals = _normals(np.array([_main_direction(likely)]))
    lines = _find_lines(likely, normals)
    pieces = _cut(points, normals, lines) if lines else []
    return sorted(pieces, key=lambda each: -each.length)


def _normals(angles: Floats) -> Floats:
    """Normals (2 a, 2) of lines in both directions of a field: at these angles (a,) [rad], then across."""
    c, s = np.cos(angles), np.sin(angles)
    return np.array([[c, s], [-s, c]]).transpose(0, 2, 1).reshape(-1, 2)


_CENTER = round(_FARTHEST / _STEP)
_REACH = np.arcsinh(np.arange(-_CENTER, _CENTER + 1) * _STEP)
_BINS = np.floor((_REACH - _REACH[0]) / _BIN).astype(np.intp) + 1  # bin 0 is empty: it divides the rows
_COUNT = int(_BINS[-1]) + 1
_TRIED = np.arange(_ANGLES, dtype=np.float64) * (0.5 * math.pi / _ANGLES)
_NORMALS = _normals(_TRIED).astype(np.float32)


def _bins(offsets: Floats | Singles) -> Chosen:
    """Bins (r, n) of lines at these distances (r, n) [m] from the camera: finer for near lines. Each row has its
    own bins."""
    steps = (offsets * (1.0 / _STEP) + (_CENTER + 0.5)).astype(np.intp)
    return np.asarray(_BINS[steps] + _COUNT * np.arange(len(offsets))[:, None])


def _main_direction(points: LinePoints) -> float:
    """The direction [rad], from 0 to a right angle, in which most points share a line, or at a right angle to it."""
    some = points.part(slice(None, None, -(-len(points) // _MOST_VOTERS)))
    bins = _bins(_NORMALS @ some.positions.T.astype(np.float32))
    votes = np.bincount(bins.ravel(), np.tile(some.weights, len(bins)), len(bins) * _COUNT)
    peaks = (votes.reshape(2, _ANGLES, _COUNT) ** 2).sum(axis=(0, 2))
    best = int(np.argmax(peaks))
    before, most, after = peaks[[best - 1, best, (best + 1) % _ANGLES]].tolist()
    shift = 0.5 * (after - before) / max(2.0 * most - before - after, 1e-9)  # of the parabola through the three
    return float(_TRIED[best] + shift * _TRIED[1])


@dataclass(frozen=True, eq=False)
class _Line:
    """A fitted line: the number of its normal, a point [m], its direction, and the numbers of its likely points."""

    axis: int
    middle: tuple[float, float]
    direction: tuple[float, float]
    members: Chosen


def _find_lines(points: LinePoints, normals: Floats) -> list[_Line]:
    """Lines across two normals (2, 2), each fitted to likely points that no line before has."""
    offsets = normals @ points.positions.T
    bins, reach = _bins(offsets), points.tolerance(offsets)
    moments = np.ones((6, len(points)))  # 1, x, y, x^2, x y and y^2
    moments[1:3] = points.positions.T
    moments[3:5], moments[5] = moments[1] * moments[1:3], moments[2] ** 2
    weights = np.array([points.weights, points.weights], dtype=np.float64)  # 0 where not free
    precision = weights / reach**2
    lines: list[_Line] = []
    for _ in range(_MOST_LINES):
        votes = np.bincount(bins.ravel(), weights.ravel(), 2 * _COUNT)
        votes[:-1] += votes[1:]  # a line may fall between two bins
        peak = int(np.argmax(votes))
        if votes[peak] < _LEAST_VOTES:
            break
        axis = peak // _COUNT
        near = (bins[axis] == peak) | (bins[axis] == peak + 1)
        middle, direction, on = _fit(moments, precision[axis], reach[axis], near, normals[axis])
        members = np.flatnonzero(on & (weights[0] > 0.0))
        if len(members) >= _FEWEST:
            lines.append(_Line(axis, middle, direction, members))
        left = ~(on | near)
        weights *= left
        precision *= left
    return lines


def _fit(
    moments: Floats, precision: Floats, reach: Floats, near: Mask, normal: Floats
) -> tuple[tuple[float, float], tuple[float, float], Mask]:
    """A point [m] of a line through points with moments (6, n) and precision (n,), its direction, and which points
    (n,) are on it.

    reach (n,): how far a point may be from the line [m]. near (n,): the points to begin with. normal (2,): the expected
    normal.
    """
    ex, ey, on = -float(normal[1]), float(normal[0]), near  # the expected direction
    for _ in range(2):
        total, sx, sy, sxx, sxy, syy = (moments @ (precision * on)).tolist()
        if total <= 0.0:
            break
        mx, my = sx / total, sy / total
        xx, xy, yy = sxx - sx * mx, sxy - sx * my, syy - sy * my
        angle = 0.5 * math.atan2(2.0 * xy, xx - yy)  # of the longer axis
        turn = math.remainder(angle - math.atan2(ey, ex), math.pi)
        if abs(turn) > _TURN:
            turn = 0.0  # its points are a blob, or belong to a line at a right angle
        certainty = max(ex * ex * xx + 2.0 * ex * ey * xy + ey * ey * yy, 0.0) / _NOISE**2
        kept = turn * certainty / (certainty + 1.0 / _ERROR**2)
        c, s = math.cos(kept), math.sin(kept)
        dx, dy = c * ex - s * ey, s * ex + c * ey
        on = np.abs(np.array([my * dx - mx * dy, dy, -dx]) @ moments[:3]) < reach
    return (mx, my), (dx, dy), on


def _cut(points: LinePoints, normals: Floats, lines: list[_Line]) -> list[Piece]:
    """The pieces of lines that their points speak for."""
    middles, directions = np.array([each.middle for each in lines]), np.array([each.direction for each in lines])
    across = directions[:, ::-1] * (1.0, -1.0)
    distances = (across * middles).sum(axis=1, keepdims=True)
    reach = points.tolerance(normals @ points.positions.T)[[each.axis for each in lines]]
    places = points.positions.T.astype(np.float32)
    off = across.astype(np.float32) @ places
    off -= distances.astype(np.float32)
    on = np.flatnonzero(np.abs(off, out=off) < reach)
    along = (directions.astype(np.float32) @ places).ravel()[on]  # [m] from the place next to the camera
    line = on // len(points)
    order = np.argsort(along + 4.0 * _FARTHEST * line)
    line, along = line[order], along[order]
    point = on[order] - len(points) * line
    likely = np.flatnonzero(points.weights > LEAST)
    owner = np.full(len(points), -1)
    for number, each in enumerate(lines):
        owner[likely[each.members]] = number
    own = np.flatnonzero(owner[point] == line)
    members = np.searchsorted(likely, point[own])
    values = points.weights[point].astype(np.float64) - _EXPECTED
    stretches = _best_stretches(values, line, _LEAST_SUPPORT, _MOST_AGAINST)
    spans = np.array([each[:2] for each in stretches], dtype=np.intp).reshape(-1, 2)
    feet = across * distances
    ends = feet[line[spans]] + along[spans][..., None] * directions[line[spans]]
    bounds = np.searchsorted(own, spans + np.array([0, 1])).tolist()
    pieces = (
        Piece(its_ends, members[first:end], support)
        for its_ends, (first, end), (_, _, support) in zip(ends, bounds, stretches, strict=True)
    )
    return [each for each in pieces if each.length >= _SHORTEST and len(each.members) > 1]


def _best_stretches(values: Floats, groups: Chosen, least: float, lost: float) -> list[tuple[int, int, float]]:
    """First and last position and sum of stretches of the values (n,): in each group the stretch with the largest sum,
    and those of what is left on its two sides, as long as a sum is at least `least`.

    groups (n,): number of each value's group, ascending from 0. lost: negative values in a row with a sum below -lost
    are in no stretch. Ruzzo and Tompa, "A linear time algorithm for finding all maximal scoring subsequences", 1999.
    """
    if not len(values):
        return []
    starts = starts_of_runs(2 * groups + (values < 0.0))
    sums, ends = np.add.reduceat(values, starts), [*starts[1:].tolist(), len(values)]
    found: list[tuple[int, int, float, float]] = []  # positions; sums of all values before and up to the end
    total, group, base = 0.0, -1, 0  # stretches before `base` are complete
    for first, end, gain, of in zip(starts.tolist(), ends, sums.tolist(), groups[starts].tolist(), strict=True):
        if of != group or gain < -lost:
            group, base = of, len(found)
        low, total = total, total + gain
        if gain <= 0.0:
            continue
        number = len(found)
        while number > base:
            number -= 1
            if found[number][2] < low:
                if found[number][3] >= total:
                    break
                first, _, low, _ = found[number]
                del found[number:]
        found.append((first, end - 1, low, total))
    return [(first, last, high - low) for first, last, low, high in found if high - low >= least]
