"""The center circle among the line points that are on no long straight line.

Circles through three of the points are tried (Fischler and Bolles, "Random sample consensus", 1981), always the same
ones. The one with the most points on it is fitted to them, if they cover enough of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats
from .lines import LinePoints, tolerance

_TRIES = 300
"""Number of circles that are tried."""

_SHARES = np.outer(np.arange(1, _TRIES + 1), np.sqrt([2.0, 3.0, 5.0])) % 1.0
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
    searched = points.part(free)
    best = _best_circle(searched.part(slice(None, None, -(-len(free) // _MOST_VOTERS))))
    if best is None:
        return None
    center, radius = best
    for _ in range(2):
        normals, off, reach = _around(searched, center, radius)
        on = np.abs(off) < reach
        if np.count_nonzero(on) < _FEWEST:
            return None
        # One step of Gauss and Newton towards the least squares of distances, weighted by precision.
        precision = np.sqrt(searched.weights * on) / reach
        slopes = np.array([*normals, np.ones(len(off))]) * precision
        step = np.linalg.lstsq(slopes @ slopes.T, slopes @ (off * precision), rcond=None)[0]
        center, radius = center + step[:2], radius + float(step[2])
    return _checked(points, free, center, radius)


def _best_circle(points: LinePoints) -> tuple[Floats, float] | None:
    """Center (2,) [m] and radius [m] of the circle through three points that most of them are on."""
    centers, radii = _through(points.positions.T[(_SHARES * len(points)).astype(np.intp)])
    possible = (radii > _RADII[0]) & (radii < _RADII[1])
    if not possible.any():
        return None
    centers, radii = centers[possible], radii[possible]
    x, y = points.positions.astype(np.float32)[:, :, None] - centers.T.astype(np.float32)[:, None]  # (n, t)
    off = np.abs(np.sqrt(x * x + y * y) - radii.astype(np.float32))
    ranges = np.hypot(*points.positions) / points.ground.height
    tolerance = 0.04 + 0.3 * points.ground.across * np.sqrt(ranges**2 + 1.0)
    best = int(np.argmax(points.weights @ (2.0 * (off < tolerance[:, None]) - (off < 0.5 * radii))))
    return centers[best], float(radii[best])


def _through(triples: Floats) -> tuple[Floats, Floats]:
    """Centers (t, 2) and radii (t,) of circles through three points each (t, 3, 2); NaN for points in a row."""
    a, b = triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0]
    area = 2.0 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    area[np.abs(area) < 1e-6] = np.nan
    aa, bb = (a**2).sum(axis=1), (b**2).sum(axis=1)
    x = (b[:, 1] * aa - a[:, 1] * bb) / area
    y = (a[:, 0] * bb - b[:, 0] * aa) / area
    return triples[:, 0] + np.array([x, y]).T, np.hypot(x, y)


def _around(points: LinePoints, center: Floats, radius: float) -> tuple[Floats, Floats, Floats]:
    """Unit vectors (2, n) from the center of a circle to points, how far they are outside of it (n,) [m], and how far
    they may be (n,) [m]."""
    places = points.positions
    away = places - center[:, None]
    lengths = np.maximum(np.hypot(*away), 1e-9)
    away /= lengths
    return away, lengths - radius, tolerance((places * away).sum(axis=0), points.leaning, points.ground)


def _checked(points: LinePoints, free: Chosen, center: Floats, radius: float) -> CirclePoints | None:
    """The circle with all its points, or None if it is too small, too large, or too little of it is seen."""
    (x, y), off, reach = _around(points, center, radius)
    on = np.abs(off) < reach
    members = np.flatnonzero(on)
    if not _RADII[0] < radius < _RADII[1] or len(members) < _FEWEST:
        return None
    sectors = np.floor(np.arctan2(y[on], x[on]) * (0.5 * _SECTORS / math.pi)).astype(np.intp) % _SECTORS
    arc = np.count_nonzero(np.bincount(sectors)) / _SECTORS
    weights = points.weights
    total = float(weights[on].sum())
    around = float(weights[np.abs(off) < _AROUND * radius].sum())
    own = float(weights[free[on[free]]].sum())
    if arc < _LEAST_ARC or total < _LEAST_PURE * around or own < _LEAST_OWN * total:
        return None
    return CirclePoints(center, radius, arc, members)
