"""Straight pieces of field lines among the points of the class line.

All lines of a field are parallel or at right angles, except for its circle. A Hough transform of the line points finds
the two directions. Lines in these directions are taken one after the other, best first, and fitted to their points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats, Mask, Singles
from .ground_points import GroundPoints

_LEAST = 0.1
"""Points with a smaller probability of the class line are ignored."""

_FARTHEST = 10.0
"""Farther points [m] are ignored: a line there is narrower than a pixel of most cameras."""

_ANGLES = 45
"""Directions that the Hough transform tries, from 0 to a right angle."""

_MOST_VOTERS = 400
"""Largest number of points that choose the direction."""

_BIN = 0.06
"""Width of a bin of the Hough transform [m], at the camera; it grows with the distance of the line."""

_MOST_ROUNDS = 14
"""Largest number of searches for a line, which may have several pieces."""

_LEAST_MEAN = 0.25
"""The points of a line have at least this mean probability."""

_SHORTEST = 0.2
"""Shorter pieces [m] are no lines."""

_FEWEST = 4
"""A line has at least so many points."""

_GAP = 1.0
"""Wider gaps [m] divide a line into pieces, unless the mesh is even coarser there."""

_TURN = 0.15
"""A fitted line turns by less than this [rad] from the direction that the Hough transform found."""


@dataclass(frozen=True, eq=False)
class LinePoints:
    """The n points that may be on lines. positions (n, 2) [m]. weights (n,): their probabilities. radial (n, 2): unit
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
        outward = np.abs((self.radial * normals).sum(axis=1))
        return np.asarray(0.04 + 0.7 * (outward * self.blur + (1.0 - outward) * self.across))

    def spacing(self, chosen: Chosen, direction: Floats) -> Floats:
        """Distance (m,) [m] to the next point along a direction (2,), at chosen points (m,)."""
        outward = np.abs(self.radial[chosen] @ direction)
        return np.asarray(2.0 * (outward * self.blur[chosen] + (1.0 - outward) * self.across))

    def part(self, chosen: Mask | Chosen) -> LinePoints:
        """Some of the points."""
        return LinePoints(
            self.positions[chosen], self.weights[chosen], self.radial[chosen], self.blur[chosen], self.across
        )


@dataclass(frozen=True, eq=False)
class Piece:
    """A straight piece of a line: its ends (2, 2) [m], and the numbers of its points."""

    ends: Floats
    members: Chosen

    @property
    def length(self) -> float:
        """Distance between the ends [m]."""
        return float(np.hypot(*(self.ends[1] - self.ends[0])))


def line_points(points: GroundPoints) -> LinePoints:
    """The points that may be on lines; none if the network has no class line."""
    probabilities = points.classes.get("line", np.zeros(len(points.ranges), np.float32))
    chosen = np.flatnonzero((probabilities > _LEAST) & (points.ranges < _FARTHEST) & (points.ranges > 1e-3))
    ranges, positions = points.ranges[chosen], points.positions[chosen]
    return LinePoints(
        positions,
        probabilities[chosen],
        positions / ranges[:, None],
        0.5 * points.along(ranges),
        0.5 * points.across,
    )


def find_pieces(points: LinePoints) -> list[Piece]:
    """Straight pieces of lines, longest first."""
    if len(points) < _FEWEST:
        return []
    angle = _main_direction(points)
    normals = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    bins = _bins(points.positions @ normals.T)  # (n, 2): of lines across both directions
    free = np.ones(len(points), dtype=bool)
    pieces: list[Piece] = []
    for _ in range(_MOST_ROUNDS):
        votes = [np.bincount(each[free], points.weights[free], minlength=_COUNT) for each in bins.T]
        sums = [each[:-1] + each[1:] for each in votes]  # a line may fall between two bins
        axis = int(sums[1].max() > sums[0].max())
        peak = int(np.argmax(sums[axis]))
        if sums[axis][peak] < 0.7 * _FEWEST:
            break
        near = free & ((bins[:, axis] == peak) | (bins[:, axis] == peak + 1))
        members, middle, direction = _fit(points, near, free, normals[axis])
        found = _cut(points, members, middle, direction)
        pieces += found
        free[members] = False
        free[near] = False
    return sorted(pieces, key=lambda each: -each.length)


_REACH = np.arcsinh(_FARTHEST)
_COUNT = 2 * int(np.ceil(_REACH / _BIN)) + 2


def _bins(offsets: Floats) -> Chosen:
    """Bins of lines at these distances [m] from the camera: finer for near lines."""
    return np.asarray(np.floor((np.arcsinh(offsets) + _REACH) / _BIN), dtype=np.intp)


def _main_direction(points: LinePoints) -> float:
    """The direction [rad], from 0 to a right angle, in which most points share a line, or at a right angle to it."""
    some = points.part(np.arange(0, len(points), -(-len(points) // _MOST_VOTERS)))
    angles = np.arange(_ANGLES) * (0.5 * np.pi / _ANGLES)
    normals = np.concatenate([[np.cos(angles), np.sin(angles)], [-np.sin(angles), np.cos(angles)]], axis=1)  # (2, 2A)
    bins = _bins(some.positions @ normals) + _COUNT * np.arange(2 * _ANGLES)
    weights = np.broadcast_to(some.weights[:, None], bins.shape)
    votes = np.bincount(bins.ravel(), weights.ravel(), minlength=2 * _ANGLES * _COUNT).reshape(2, _ANGLES, _COUNT)
    return float(angles[np.argmax((votes**2).sum(axis=(0, 2)))])


def _fit(points: LinePoints, near: Mask, free: Mask, normal: Floats) -> tuple[Chosen, Floats, Floats]:
    """Numbers of the free points on a line, a point of the line (2,) [m], and its direction (2,).

    near: the points to begin with. normal (2,): the line's normal; the fit does not turn it by more than a little.
    """
    first, members = normal, np.flatnonzero(near)
    tolerance = points.tolerance(normal)
    weights = points.weights / tolerance**2
    for _ in range(3):
        own = weights[members]
        middle = own @ points.positions[members] / own.sum()
        away = points.positions[members] - middle
        (xx, xy), (_, yy) = (away * own[:, None]).T @ away
        angle = 0.5 * math.atan2(2.0 * xy, xx - yy)  # of the longer axis
        turned = np.array([-math.sin(angle), math.cos(angle)])
        if abs(turned @ first) > math.cos(_TURN):
            normal = turned
        members = np.flatnonzero((np.abs((points.positions - middle) @ normal) < tolerance) & free)
        if len(members) < 2:
            break
    return members, middle, np.array([-normal[1], normal[0]])


def _cut(points: LinePoints, members: Chosen, middle: Floats, direction: Floats) -> list[Piece]:
    """The pieces of a line between its gaps."""
    if len(members) < _FEWEST:
        return []
    t = (points.positions[members] - middle) @ direction
    order = np.argsort(t)
    t, members = t[order], members[order]
    widest = np.maximum(_GAP, 2.0 * points.spacing(members, direction))
    ends = np.append(np.flatnonzero(np.diff(t) > np.minimum(widest[1:], widest[:-1])), len(t) - 1)
    starts = np.append(0, ends[:-1] + 1)
    return [
        Piece(middle + np.outer([t[a], t[b]], direction), members[a : b + 1])
        for a, b in zip(starts, ends, strict=True)
        if b - a + 1 >= _FEWEST
        and t[b] - t[a] >= _SHORTEST
        and points.weights[members[a : b + 1]].mean() >= _LEAST_MEAN
    ]
