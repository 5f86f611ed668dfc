"""Straight pieces of field lines among the points of the class line.

All lines of a field are parallel or at right angles, except for its circle. A Hough transform of the line points finds
the two directions. Lines in these directions are taken one after the other, best first, and fitted to their points.
Each fitted line makes the two directions more certain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats, Mask, Singles
from .ground_points import GroundPoints

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

_MOST_ROUNDS = 14
"""Largest number of searches for a line, which may have several pieces."""

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

_FIRST_ERROR = 0.015
"""Standard deviation [rad] of the direction that the Hough transform finds."""

_SKEW = 0.01
"""Standard deviation [rad] of the direction of one line: fields are painted, and poses are measured, with errors."""

_NOISE = 0.5
"""Standard deviation of a point's distance from its line, as a share of its tolerance."""

_SAME_DIRECTION = 0.004
"""A turn of the two directions [rad] that does not yet need new bins."""


def tolerance(outward: Floats, blur: Floats, across: float) -> Floats:
    """How far (...) [m] a point may be from a line's middle.

    outward (...): how much the line's normal points away from the camera, 0 to 1. blur (...), across [m]: as those of
    LinePoints.
    """
    return np.asarray(outward * (0.7 * (blur - across)) + (0.04 + 0.7 * across))


@dataclass(frozen=True, eq=False)
class LinePoints:
    """n points near enough for lines. positions (n, 2) [m]. weights (n,): their probabilities. radial (n, 2): unit
    vectors away from the camera. blur (n,) [m]: half the distance between rings of the mesh there. across [m]: half
    the distance between points of a ring."""

    positions: Floats
    weights: Singles
    radial: Floats
    blur: Floats
    across: float

    def __len__(self) -> int:
        return len(self.positions)

    def tolerance(self, normals: Floats) -> Floats:
        """How far (n,) [m] a point may be from a line's middle, across unit vectors (2,) or (n, 2)."""
        outward = self.radial @ normals if normals.ndim == 1 else np.einsum("ij,ij->i", self.radial, normals)
        return tolerance(np.abs(outward), self.blur, self.across)

    def part(self, chosen: Mask | Chosen) -> LinePoints:
        """Some of the points."""
        return LinePoints(
            self.positions[chosen], self.weights[chosen], self.radial[chosen], self.blur[chosen], self.across
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
        return float(np.hypot(*(self.ends[1] - self.ends[0])))


def line_points(points: GroundPoints) -> LinePoints:
    """All points near enough for lines, with the probability 0 if the network has no class line."""
    probabilities = points.classes.get("line", np.zeros(len(points.ranges), np.float32))
    chosen = np.flatnonzero((points.ranges < _FARTHEST) & (points.ranges > 1e-3))
    ranges, positions = points.ranges[chosen], points.positions[chosen]
    return LinePoints(
        positions,
        probabilities[chosen],
        positions / ranges[:, None],
        0.5 * points.along(ranges),
        0.5 * points.across,
    )


def find_pieces(points: LinePoints, likely: LinePoints) -> list[Piece]:
    """Straight pieces of lines, longest first.

    points: all points near enough for lines. likely: those of them with a probability above LEAST.
    """
    if len(likely) < _FEWEST:
        return []
    angle, certainty = _main_direction(likely), 1.0 / _FIRST_ERROR**2
    binned, bins = angle, _bins(likely, angle)
    # A line turns little from these normals, so how far its points may be changes little, too.
    normals = _normals(angle)
    reaches = [[each.tolerance(normal) for normal in normals] for each in (points, likely)]
    moments = _moments(likely.positions)
    free = np.ones(len(likely), dtype=bool)
    weights = likely.weights.astype(np.float64)  # 0 where not free
    pieces: list[Piece] = []
    for _ in range(_MOST_ROUNDS):
        votes = [np.bincount(each, weights, minlength=_COUNT) for each in bins]
        sums = [each[:-1] + each[1:] for each in votes]  # a line may fall between two bins
        axis = int(sums[1].max() > sums[0].max())
        peak = int(np.argmax(sums[axis]))
        if sums[axis][peak] < _LEAST_VOTES:
            break
        near = free & ((bins[axis] == peak) | (bins[axis] == peak + 1))
        line = _fit(moments, weights, reaches[1][axis], near, free, _normals(angle)[axis], _SKEW**2 + 1.0 / certainty)
        found = _cut(points, reaches[0][axis], likely, line)
        pieces += found
        free[line.members] = False
        free[near] = False
        weights[~free] = 0.0
        if found:
            weight = 1.0 / (_SKEW**2 + 1.0 / max(line.certainty, 1e-9))
            certainty += weight
            angle += line.turn * weight / certainty
            if abs(angle - binned) > _SAME_DIRECTION:
                binned, bins = angle, _bins(likely, angle)
    return sorted(pieces, key=lambda each: -each.length)


def _normals(angle: float) -> Floats:
    """Normals (2, 2) of lines in both directions of a field, the first one at this angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])


_REACH = np.arcsinh(_FARTHEST)
_COUNT = 2 * int(np.ceil(_REACH / _BIN)) + 2


def _bins(points: LinePoints, angle: float) -> Chosen:
    """Bins (2, n) of the lines through n points in both directions of a field, whose first normal is at an angle
    [rad]."""
    return _bins_at(_normals(angle) @ points.positions.T)


def _bins_at(offsets: Floats) -> Chosen:
    """Bins of lines at these distances [m] from the camera: finer for near lines."""
    return np.asarray(np.floor((np.arcsinh(offsets) + _REACH) / _BIN), dtype=np.intp)


def _main_direction(points: LinePoints) -> float:
    """The direction [rad], from 0 to a right angle, in which most points share a line, or at a right angle to it."""
    some = points.part(np.arange(0, len(points), -(-len(points) // _MOST_VOTERS)))
    angles = np.arange(_ANGLES) * (0.5 * np.pi / _ANGLES)
    normals = np.concatenate([[np.cos(angles), np.sin(angles)], [-np.sin(angles), np.cos(angles)]], axis=1)  # (2, 2A)
    bins = _bins_at(some.positions @ normals) + _COUNT * np.arange(2 * _ANGLES)
    weights = np.broadcast_to(some.weights[:, None], bins.shape)
    votes = np.bincount(bins.ravel(), weights.ravel(), minlength=2 * _ANGLES * _COUNT).reshape(2, _ANGLES, _COUNT)
    return float(angles[np.argmax((votes**2).sum(axis=(0, 2)))])


@dataclass(frozen=True, eq=False)
class _Line:
    """A fitted line: a point of it (2,) [m], its direction (2,), and the numbers of its likely points. turn [rad]: from
    the expected direction to the one of the points alone. certainty: one over the variance of this direction."""

    middle: Floats
    direction: Floats
    members: Chosen
    turn: float
    certainty: float


def _moments(positions: Floats) -> Floats:
    """1, x, y, x^2, x y and y^2 (6, n) of n places (n, 2)."""
    x, y = positions.T
    return np.stack([np.ones(len(x)), x, y, x * x, x * y, y * y])


def _fit(
    moments: Floats, weights: Floats, reach: Floats, near: Mask, free: Mask, normal: Floats, variance: float
) -> _Line:
    """A line through free points with moments (6, n) and weights (n,).

    reach (n,): how far a point may be from the line [m]. near (n,): the points to begin with. normal (2,): the expected
    normal, whose direction has this variance [rad^2].
    """
    _, x, y = moments[:3]
    ex, ey = -float(normal[1]), float(normal[0])  # the expected direction
    precise = moments * (weights / reach**2)
    members = near
    for _ in range(3):
        total, sx, sy, sxx, sxy, syy = (precise * members).sum(axis=1).tolist()
        mx, my = sx / total, sy / total
        xx, xy, yy = sxx - sx * mx, sxy - sx * my, syy - sy * my
        angle = 0.5 * math.atan2(2.0 * xy, xx - yy)  # of the longer axis
        turn = math.remainder(angle - math.atan2(ey, ex), math.pi)
        if abs(turn) > _TURN:
            turn = 0.0  # its points are a blob, or belong to a line at a right angle
        certainty = max(ex * ex * xx + 2.0 * ex * ey * xy + ey * ey * yy, 0.0) / _NOISE**2
        kept = turn * certainty / (certainty + 1.0 / variance)
        c, s = math.cos(kept), math.sin(kept)
        dx, dy = c * ex - s * ey, s * ex + c * ey
        off = x * dy
        off -= y * dx
        off -= mx * dy - my * dx
        members = np.abs(off, out=off) < reach
        members &= free
        if np.count_nonzero(members) < 2:
            break
    return _Line(np.array([mx, my]), np.array([dx, dy]), np.flatnonzero(members), turn, certainty)


def _cut(points: LinePoints, reach: Floats, likely: LinePoints, line: _Line) -> list[Piece]:
    """The pieces of a line that its points speak for. reach (n,): how far each of the points may be from it [m]."""
    if len(line.members) < _FEWEST:
        return []
    normal = np.array([line.direction[1], -line.direction[0]])
    off = np.abs(points.positions @ normal - line.middle @ normal)
    on = np.flatnonzero(off < reach)
    t = (points.positions[on] - line.middle) @ line.direction
    order = np.argsort(t)
    t, values = t[order], points.weights[on[order]].astype(np.float64) - _EXPECTED
    along = (likely.positions[line.members] - line.middle) @ line.direction
    pieces = []
    for first, last, support in _best_stretches(values, _LEAST_SUPPORT, _MOST_AGAINST):
        members = line.members[(along >= t[first]) & (along <= t[last])]
        if t[last] - t[first] >= _SHORTEST and len(members) > 1:
            ends = line.middle + np.outer([t[first], t[last]], line.direction)
            pieces.append(Piece(ends, members, support))
    return pieces


def _best_stretches(values: Floats, least: float, lost: float) -> list[tuple[int, int, float]]:
    """First and last position and sum of stretches of the values (n,): the stretch with the largest sum, and those of
    what is left on its two sides, as long as a sum is at least `least`.

    lost: negative values in a row with a sum below -lost are in no stretch.
    """
    if not len(values):
        return []
    found = []
    starts = np.flatnonzero(np.diff(values < 0.0, prepend=values[0] >= 0.0))  # of runs with the same sign
    ends = np.append(starts[1:], len(values))
    gaps = np.add.reduceat(values, starts) < -lost
    rest = list(zip(np.append(0, ends[gaps]).tolist(), np.append(starts[gaps], len(values)).tolist(), strict=True))
    gains = np.concatenate([[0.0], np.cumsum(np.maximum(values, 0.0))])
    while rest:
        start, end = rest.pop()
        if gains[end] - gains[start] < least:
            continue
        sums = np.concatenate([[0.0], np.cumsum(values[start:end])])
        lowest = np.minimum.accumulate(sums)
        last = int(np.argmax(sums - lowest))
        best = float(sums[last] - lowest[last])
        if best < least:
            continue
        first = int(np.flatnonzero(sums[: last + 1] == lowest[last])[-1])
        found.append((start + first, start + last - 1, best))
        rest += [(start, start + first), (start + last, end)]
    return found
