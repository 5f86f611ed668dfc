"""Straight pieces of field lines among the points of the class line.

All lines of a field are parallel or at right angles, except for its circle. A Hough transform of the line points finds
the two directions. Lines in these directions are taken one after the other, best first, and fitted to their points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import Chosen, Floats, Mask, Number, Singles
from .ground_points import GroundPoints, starts_of_runs

LEAST = 0.1
"""Points with a smaller probability of the class line suggest no line."""

_FARTHEST = 10.0
"""Farther points [m] are ignored: a line there is narrower than a pixel of most cameras."""

_ANGLES = 45
"""Directions that the Hough transform tries, from 0 to a right angle."""

_MOST_VOTERS = 100
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


@dataclass(frozen=True, eq=False)
class LinePoints:
    """n points near enough for lines.

    positions (2, n) [m]. weights (n,): probabilities of a line there. leaning (n,): see GroundMap. ground: all points
    of the frame.
    """

    positions: Floats
    weights: Singles
    leaning: Singles
    ground: GroundPoints

    def __len__(self) -> int:
        return len(self.weights)

    def part(self, chosen: Chosen) -> LinePoints:
        """Some of the points."""
        return LinePoints(
            self.positions.take(chosen, axis=1), self.weights.take(chosen), self.leaning.take(chosen), self.ground
        )


def tolerance(offsets: Number, leaning: Number, ground: GroundPoints) -> Number:
    """How far (...) [m] a point may be from a line's middle: by more than half the way to the next point.

    offsets (...) [m]: how far the points are from the camera along the line's normal. leaning (...): see GroundMap.
    ground: has the spacing of the points.
    """
    half = 0.35 * ground.across
    return np.abs(offsets) * leaning * (half / ground.height) + (0.04 + half)


class Piece(NamedTuple):
    """A straight piece of a line: its ends (2, 2) [m], its length [m], the numbers of its likely points, and its
    support: the sum of what all points on it have above the probability from which a point speaks for a line."""

    ends: Floats
    length: float
    members: Chosen
    support: float


def line_points(points: GroundPoints) -> LinePoints:
    """All points near enough for lines."""
    ground, height = points.map, points.height
    first, end = np.searchsorted(ground.ranges, (1e-3 / height, _FARTHEST / height)).tolist()
    near = points.shown.take(ground.numbers[first:end]).nonzero()[0]
    near += first
    return LinePoints(
        (height * points.heading) @ ground.places.take(near, axis=1),  # take is much faster than an index here
        np.fmax(points.line.take(ground.numbers.take(near)), np.float32(0.0)),  # 0 for NaN
        ground.leaning.take(near),
        points,
    )


def find_pieces(points: LinePoints, likely: LinePoints) -> list[Piece]:
    """Straight pieces of lines, longest first.

    points: all points near enough for lines. likely: those of them with a probability above LEAST.
    """
    if len(likely) < _FEWEST:
        return []
    normals = _normals(_main_direction(likely))
    lines = _find_lines(likely, normals)
    pieces = _cut(points, normals, lines) if lines else []
    return sorted(pieces, key=lambda each: -each.length)


def _normals(angles: Floats | float) -> Floats:
    """Normals (2, ..., 2) of lines in both directions of a field: at these angles (...) [rad], then across."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)])


_CENTER = round(_FARTHEST / _STEP)
_REACH = np.arcsinh(np.arange(-_CENTER, _CENTER + 1) * _STEP)
_BINS = np.floor((_REACH - _REACH[0]) / _BIN).astype(np.intp) + 1  # bin 0 is empty: it divides the rows
_COUNT = int(_BINS[-1]) + 1
_TRIED = np.arange(_ANGLES, dtype=np.float64) * (0.5 * math.pi / _ANGLES)
_NORMALS = _normals(_TRIED).reshape(-1, 2).astype(np.float32)


def _bins(normals: Number, places: Number) -> Chosen:
    """Bins (r, n) of lines with normals (r, 2) through places (2, n) [m]: by their distances from the camera, finer for
    near lines. Each row has its own bins."""
    steps = (normals * (1.0 / _STEP)) @ places
    steps += _CENTER + 0.5
    bins = np.asarray(_BINS.take(steps.astype(np.intp)))
    bins += np.arange(0, _COUNT * len(normals), _COUNT)[:, None]
    return bins


def _main_direction(points: LinePoints) -> float:
    """The direction [rad], from 0 to a right angle, in which most points share a line, or at a right angle to it."""
    some = slice(None, None, -(-len(points) // _MOST_VOTERS))
    bins = _bins(_NORMALS, points.positions[:, some].astype(np.float32))
    weights = np.broadcast_to(points.weights[some].astype(np.float64), bins.shape)
    votes = np.bincount(bins.ravel(), weights.ravel(), len(bins) * _COUNT).reshape(2, _ANGLES, _COUNT)
    peaks = np.einsum("aij,aij->i", votes, votes)
    best = int(np.argmax(peaks))
    before, most, after = peaks[[best - 1, best, (best + 1) % _ANGLES]].tolist()
    shift = 0.5 * (after - before) / max(2.0 * most - before - after, 1e-9)  # of the parabola through the three
    return float(_TRIED[best] + shift * _TRIED[1])


_ENDS = np.array([0, 1])
"""From the numbers of the first and the last to the first and the one behind the last."""


class _Line(NamedTuple):
    """A fitted line: the number of its normal, its direction, its distance to the left of the point below the camera
    [m], and the numbers of its likely points."""

    axis: int
    direction: complex
    distance: float
    members: Chosen


def _find_lines(points: LinePoints, normals: Floats) -> list[_Line]:
    """Lines across two normals (2, 2), each fitted to likely points that no line before has. Those across the first
    normal are first."""
    (x, y), count = points.positions, len(points)
    offsets = normals @ points.positions
    bins, reach = _bins(normals, points.positions), tolerance(offsets, points.leaning, points.ground)
    moments = np.array([np.ones(count), x, y, x * x, x * y, y * y])
    free = np.empty((4, count))  # weights, twice, and precisions; 0 where not free
    free[:2] = points.weights
    np.divide(points.weights, reach * reach, out=free[2:])
    weights, all_bins, expected = free[:2].reshape(-1), bins.reshape(-1), normals.tolist()
    lines: list[_Line] = []
    for _ in range(_MOST_LINES):
        votes = np.bincount(all_bins, weights, 2 * _COUNT)
        votes[:-1] += votes[1:]  # a line may fall between two bins
        peak = int(votes.argmax())
        if votes[peak] < _LEAST_VOTES:
            break
        axis = peak // _COUNT
        near = (bins[axis] - peak).view(np.uintp) < 2
        direction, distance, on = _fit(moments, free[2 + axis], reach[axis], near, expected[axis])
        members = (on & (weights[:count] > 0.0)).nonzero()[0]
        if len(members) >= _FEWEST:
            lines.append(_Line(axis, direction, distance, members))
        free *= ~(on | near)
    return sorted(lines, key=lambda each: each.axis)


def _fit(
    moments: Floats, precision: Floats, reach: Floats, near: Mask, normal: Sequence[float]
) -> tuple[complex, float, Mask]:
    """A line through points with moments (6, n) and precision (n,): its direction, its distance to the left of the
    point below the camera [m], and which points (n,) are on it.

    reach (n,): how far a point may be from the line [m]. near (n,): the points to begin with. normal (2,): the expected
    normal.
    """
    ex, ey, on, places = -normal[1], normal[0], near, moments[:3]  # the expected direction
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
        distance = my * dx - mx * dy
        on = np.abs(np.array([distance, dy, -dx]) @ places) < reach
    return complex(dx, dy), distance, on


def _cut(points: LinePoints, normals: Floats, lines: Sequence[_Line]) -> list[Piece]:
    """The pieces of lines that their points speak for. lines: as _find_lines returns them."""
    count, first = len(points), sum(each.axis == 0 for each in lines)
    directions, distances = np.array([each[1:3] for each in lines]).T
    dx, dy = directions.real, directions.imag
    places = np.ones((3, count), dtype=np.float32)
    places[:2] = points.positions
    off = np.abs(np.array([dy, -dx, distances.real], dtype=np.float32).T @ places)
    along = np.array([dx, dy], dtype=np.float32).T @ places[:2]  # [m] from the place next to the camera
    reach = tolerance(normals.astype(np.float32) @ places[:2], points.leaning, points.ground)
    on = np.concatenate([off[:first] < reach[0], off[first:] < reach[1]]).ravel().nonzero()[0]
    line, along = on // count, along.ravel()[on]
    order = (along + 4.0 * _FARTHEST * line).argsort()
    line, along = line[order], along[order]
    point = on[order] - count * line
    likely = np.flatnonzero(points.weights > LEAST)
    owner = np.full(count, -1)
    for number, each in enumerate(lines):
        owner[likely[each.members]] = number
    own = np.flatnonzero(owner[point] == line)
    members = np.searchsorted(likely, point[own])
    values = points.weights[point].astype(np.float64) - _EXPECTED
    stretches = _best_stretches(values, line, _LEAST_SUPPORT, _MOST_AGAINST)
    spans = np.array([each[:2] for each in stretches], dtype=np.intp).reshape(-1, 2)
    of, reached = line[spans[:, 0]], along[spans].astype(np.float64)
    ends = ((reached + 1j * distances[of, None]) * directions[of, None]).view(np.float64).reshape(-1, 2, 2)
    bounds = np.searchsorted(own, spans + _ENDS).tolist()
    lengths = (reached[:, 1] - reached[:, 0]).tolist()
    return [
        Piece(its_ends, length, members[start:end], support)
        for its_ends, length, (start, end), (_, _, support) in zip(ends, lengths, bounds, stretches, strict=True)
        if length >= _SHORTEST and end - start > 1
    ]


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
