"""The center circle among the line points that are on no long straight line.

Circles through three of the points are tried (Fischler and Bolles, "Random sample consensus", 1981), always the same
ones. The one with the most points on it is fitted to them, if they cover enough of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from ..arrays import Chosen, Floats
from .lines import LinePoints, tolerance

_TRIES = 300
"""Number of circles that are tried."""

_SHARES = np.outer(np.sqrt([2.0, 3.0, 5.0]), np.arange(1, _TRIES + 1)) % 1.0
"""The three points of each circle, as shares of the number of points: multiples of an irrational number are spread
evenly."""

_MOST_VOTERS = 100
"""Largest number of points that suggest circles and vote for them."""

_RADII = (0.35, 1.7)
"""Smallest and largest radius of a center circle [m]: children's fields to those of large robots."""

_FEWEST = 18
"""A circle has at least so many points."""

_SECTORS = 24
"""Equal parts of a circle, to tell how much of it is seen."""

_LEAST_ARC = 0.3
"""Share of the circle's sectors that have points on it, at least."""

_AROUND = 0.4
"""Width of the band on both sides of a circle, as a share of its radius, that must not hold much else."""

_LEAST_OWN = 0.4
"""Share of the circle's points that are on no long line, at least."""

_LEAST_PURE = 0.65
"""Share of the probability in this band that is on the circle, at least: a disk of points is no circle."""


@dataclass(frozen=True, eq=False)
class CirclePoints:
    """A circle: center (2,) [m], radius [m], the share of its sectors that have points, and its points' numbers."""

    center: Floats
    radius: float
    arc: float
    members: Chosen


def find_circle(points: LinePoints, free: Chosen) -> CirclePoints | None:
    """The circle with the most points on it, if there is one.

    free: numbers of the points to search. Its members may be any of the points.
    """
    if len(free) < _FEWEST:
        return None
    best = _best_circle(points.part(free[:: -(-len(free) // _MOST_VOTERS)]))
    if best is None:
        return None
    x, y, radius = best
    searched = points.part(free)
    for _ in range(2):
        normals, off, reach = _around(searched, x, y, radius)
        on = np.abs(off) < reach
        if np.count_nonzero(on) < _FEWEST:
            return None
        # One step of Gauss and Newton towards the least squares of distances, weighted by precision.
        precision = searched.weights * on / (reach * reach)
        slopes = np.array([*normals, np.ones(len(off))])
        weighted = slopes * precision
        step = cv2.solve(weighted @ slopes.T, (weighted @ off)[:, None], flags=cv2.DECOMP_SVD)[1]
        right, up, larger = step.ravel().tolist()
        x, y, radius = x + right, y + up, radius + larger
    return _checked(points, free, x, y, radius)


def _best_circle(points: LinePoints) -> tuple[float, float, float] | None:
    """Center x and y and radius [m] of the circle through three points that most of them are on."""
    x, y, radius = _through(points.positions.take((_SHARES * len(points)).astype(np.intp), axis=1))
    if not len(x):
        return None
    # With d, the distance to the center, both tests are products of numbers of circles and of points.
    px, py = points.positions
    squares, ones = px * px + py * py, np.ones(len(px))
    ranges = squares * (1.0 / points.ground.height**2)
    tolerance = 0.04 + 0.3 * points.ground.across * np.sqrt(ranges + 1.0)
    circles = np.array([-2.0 * x, -2.0 * y, np.ones(len(x)), x * x + y * y, radius * radius], dtype=np.float32).T
    seen = np.array([px, py, squares, ones, -ones], dtype=np.float32)
    seen[2] -= tolerance * tolerance
    off = circles @ seen  # d^2 - radius^2 - tolerance^2: within 2 radius tolerance of 0 on the circle
    on = np.abs(off) < np.outer(radius, 2.0 * tolerance).astype(np.float32)
    seen[2], seen[4] = squares, -1.25
    circles /= circles[:, 4:]
    inside = np.abs(circles @ seen) < 1.0  # 0.5 radius < d < 1.5 radius
    votes = 2.0 * (on.astype(np.float32) @ points.weights) - inside.astype(np.float32) @ points.weights
    best = int(votes.argmax())
    return float(x[best]), float(y[best]), float(radius[best])


def _through(triples: Floats) -> tuple[Floats, Floats, Floats]:
    """Centers x and y (t,) and radii (t,) of circles through three points each (2, 3, t), of those with possible
    radii."""
    first, others = triples[:, 0], triples[:, 1:] - triples[:, :1]
    (ax, bx), (ay, by) = others
    aa, bb = (others * others).sum(axis=0)
    area = 2.0 * (ax * by - ay * bx)
    area[np.abs(area) < 1e-6] = np.nan  # in a row
    x, y = (by * aa - ay * bb) / area, (ax * bb - bx * aa) / area
    radii = np.sqrt(x * x + y * y)
    possible = ((radii > _RADII[0]) & (radii < _RADII[1])).nonzero()[0]
    return (x + first[0]).take(possible), (y + first[1]).take(possible), radii.take(possible)


def _around(points: LinePoints, x: float, y: float, radius: float) -> tuple[Floats, Floats, Floats]:
    """Unit vectors (2, n) from the center of a circle to points, how far they are outside of it (n,) [m], and how far
    they may be (n,) [m]."""
    away = points.positions - [[x], [y]]
    lengths = np.maximum(np.sqrt(away[0] * away[0] + away[1] * away[1]), 1e-9)
    away /= lengths
    outward = points.positions[0] * away[0] + points.positions[1] * away[1]
    return away, lengths - radius, tolerance(outward, points.leaning, points.ground)


def _checked(points: LinePoints, free: Chosen, x: float, y: float, radius: float) -> CirclePoints | None:
    """The circle with all its points, or None if it is too small, too large, or too little of it is seen."""
    (right, up), off, reach = _around(points, x, y, radius)
    on = np.abs(off) < reach
    members = np.flatnonzero(on)
    if not _RADII[0] < radius < _RADII[1] or len(members) < _FEWEST:
        return None
    angles = np.arctan2(up.take(members), right.take(members))
    arc = len(set(np.floor(angles * (0.5 * _SECTORS / math.pi)).tolist())) / _SECTORS
    weights = points.weights
    total = float(weights[on].sum())
    around = float(weights[np.abs(off) < _AROUND * radius].sum())
    own = float(weights[free[on[free]]].sum())
    if arc < _LEAST_ARC or total < _LEAST_PURE * around or own < _LEAST_OWN * total:
        return None
    return CirclePoints(np.array([x, y]), radius, arc, members)
