"""The center circle among the line points that are on no long straight line.

Circles through three points near each other are tried (Fischler and Bolles, "Random sample consensus", 1981), always
with the same seed. The one with the most points on it is fitted to them, if they cover enough of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats, Mask
from .ground_points import cross
from .lines import LinePoints

_TRIES = 60
"""Number of circles that are tried."""

_MOST_VOTERS = 100
"""Largest number of points that suggest circles and vote for them."""

_RADII = (0.35, 1.7)
"""Smallest and largest radius of a center circle [m]: children's fields to those of large robots."""

_FEWEST = 12
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
    voters = points.part(free[:: -(-len(free) // _MOST_VOTERS)])
    centers, radii = _through(voters.positions[_triples(voters)])
    possible = (radii > _RADII[0]) & (radii < _RADII[1])
    if not possible.any():
        return None
    centers, radii = centers[possible], radii[possible]
    off = np.sqrt(_squares(voters.positions, centers)) - radii
    support = voters.weights @ (np.abs(off) < _tolerance(voters)[:, None])
    around = voters.weights @ (np.abs(off) < 0.5 * radii)
    best = int(np.argmax(2.0 * support - around))
    center, radius = centers[best], float(radii[best])
    part = points.part(free)
    for _ in range(2):
        on = _on(part, center, radius)
        if on.sum() < _FEWEST:
            return None
        center, radius = _fit(part.part(on), center, radius)
    return _checked(points, free, center, radius)


def _triples(points: LinePoints) -> Chosen:
    """Numbers (t, 3) of points that may be on one circle: each is near the first of its triple."""
    random = np.random.default_rng(0)
    first = random.integers(len(points), size=_TRIES)
    squares = _squares(points.positions[first], points.positions)
    near = squares < (2.0 * _RADII[1]) ** 2
    shares = np.cumsum(near, axis=1)
    chosen = np.ceil(random.random((_TRIES, 2)) * shares[:, -1:])
    others = [(shares < chosen[:, [column]]).sum(axis=1) for column in (0, 1)]
    return np.column_stack([first, *others])


def _squares(positions: Floats, others: Floats) -> Floats:
    """Squares (n, m) of the distances between places (n, 2) and (m, 2)."""
    x, y = (positions[:, None, axis] - others[:, axis] for axis in (0, 1))
    return x**2 + y**2


def _tolerance(points: LinePoints) -> Floats:
    """How far (n,) [m] points may be from the circle's middle line."""
    return 0.04 + 0.6 * points.blur


def _on(points: LinePoints, center: Floats, radius: float) -> Mask:
    """Which points (n,) are on a circle."""
    lengths, normals = _from_center(points, center)
    return np.asarray(np.abs(lengths - radius) < points.tolerance(normals))


def _from_center(points: LinePoints, center: Floats) -> tuple[Floats, Floats]:
    """Distances (n,) [m] of points from a center, and unit vectors (n, 2) from it to them."""
    away = points.positions - center
    lengths = np.hypot(away[:, 0], away[:, 1])
    return lengths, away / np.maximum(lengths, 1e-9)[:, None]


def _through(triples: Floats) -> tuple[Floats, Floats]:
    """Centers (t, 2) and radii (t,) of circles through three points each (t, 3, 2); infinite for points in a row."""
    a, b = triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0]
    area = 2.0 * cross(a, b)
    area[np.abs(area) < 1e-6] = np.nan
    aa, bb = (a**2).sum(axis=1), (b**2).sum(axis=1)
    x = (b[:, 1] * aa - a[:, 1] * bb) / area
    y = (a[:, 0] * bb - b[:, 0] * aa) / area
    return triples[:, 0] + np.stack([x, y], axis=1), np.nan_to_num(np.hypot(x, y), nan=np.inf)


def _fit(points: LinePoints, center: Floats, radius: float) -> tuple[Floats, float]:
    """One step of Gauss and Newton towards the circle with the least squares of distances, weighted by precision."""
    lengths, normals = _from_center(points, center)
    precision = np.sqrt(points.weights) / points.tolerance(normals)
    slopes = np.column_stack([normals, np.ones(len(lengths))]) * precision[:, None]
    step = np.linalg.lstsq(slopes, (lengths - radius) * precision, rcond=None)[0]
    return center + step[:2], radius + float(step[2])


def _checked(points: LinePoints, free: Chosen, center: Floats, radius: float) -> CirclePoints | None:
    """The circle with all its points, or None if it is too small, too large, or too little of it is seen."""
    members = np.flatnonzero(_on(points, center, radius))
    if not _RADII[0] < radius < _RADII[1] or len(members) < _FEWEST:
        return None
    away = points.positions - center
    angles = np.arctan2(away[members, 1], away[members, 0])
    sectors = np.bincount(
        ((angles + np.pi) * (_SECTORS / (2.0 * np.pi))).astype(np.intp) % _SECTORS, minlength=_SECTORS
    )
    arc = float((sectors > 0).mean())
    around = np.abs(np.hypot(away[:, 0], away[:, 1]) - radius) < _AROUND * radius
    weights = points.weights
    total = float(weights[members].sum())
    own = float(weights[np.intersect1d(members, free)].sum())
    if arc < _LEAST_ARC or total < _LEAST_PURE * float(weights[around].sum()) or own < _LEAST_OWN * total:
        return None
    return CirclePoints(center, radius, arc, members)
