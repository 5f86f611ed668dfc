"""Things that stand on the plane: each has its base where its lowest points are.

A point of something upright is seen against the plane behind the base, the farther the higher it is. So the nearest
points in each direction are at the base.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats, Mask, Singles
from .ground_points import GroundPoints


@dataclass(frozen=True)
class UprightRules:
    """What things of one class look like.

    least: points with a smaller probability are ignored. points: fewest points of a thing. jump: a thing ends in the
    direction where the base would be farther by more than this share. beside [m]: everything of the class that is so
    near beside a base belongs to it. depth: from its front to its base, as a share of its width. taller: height of a
    thing, as a share of its width, at least. foot: the base is in the direction of the middle of this share of its
    height. filled: share of the points between its sides, its base and its top that are of its class, at least. widest
    [m]: wider things are something else.
    """

    least: float
    points: int
    jump: float
    beside: float
    depth: float
    taller: float
    foot: float
    filled: float
    widest: float


POST = UprightRules(
    least=0.45, points=10, jump=0.2, beside=0.2, depth=0.3, taller=1.5, foot=0.5, filled=0.2, widest=0.5
)
ROBOT = UprightRules(
    least=0.5, points=14, jump=0.35, beside=0.3, depth=0.0, taller=1.0, foot=0.4, filled=0.2, widest=2.0
)

KINDS = {"goal": "post", "robot": "robot"}
"""What the uprights of a class are, by its name."""

_COLUMN = 0.012
"""Width of a column of points [rad]."""

_MOST = 20
"""Largest number of things of a class."""

_SAME = 0.12
"""Two bases nearer to each other than this share of their distance are those of one thing: far away, a small error in
the picture is a large one on the plane."""


@dataclass(frozen=True, eq=False)
class Base:
    """A thing on the plane: its base (2,) [m], its width across the ray [m], and its confidence: the mean probability
    of its points, or that of a peak or of a close look."""

    position: Floats
    width: float
    confidence: float


def apart(bases: Sequence[Base]) -> list[Base]:
    """Bases without those of a thing whose base is there already, nearest first. bases: most probable first."""
    places = np.array([each.position for each in bases]).reshape(-1, 2)
    ranges = np.hypot(*places.T)
    reach = np.maximum(_SAME * ranges, 0.5 * np.array([each.width for each in bases]))
    same = np.hypot(*(places[:, None] - places).T) < reach[:, None]
    kept = first_apart(same)
    return [bases[number] for number in kept[np.argsort(ranges[kept], kind="stable")]]


def first_apart(near: Mask) -> Chosen:
    """Numbers of those of p places, best first, that are not near a better one that counts itself.

    near (p, p): whether each is so near the place of the row that it is the same one.
    """
    numbers = np.arange(len(near))
    worse = near & (numbers > numbers[:, None])
    kept = np.ones(len(near), dtype=bool)
    for better in np.flatnonzero(worse.any(axis=1)):
        if kept[better]:
            kept &= ~worse[better]
    return np.flatnonzero(kept)


def find_uprights(points: GroundPoints, probabilities: Singles, rules: UprightRules) -> list[Base]:
    """Things of a class with these probabilities (n,), nearest first."""
    chosen = np.flatnonzero((probabilities > rules.least) & (points.ranges > 1e-3))
    if len(chosen) < rules.points:
        return []
    azimuths, ranges, weights = points.azimuths[chosen], points.ranges[chosen], probabilities[chosen]
    columns, fronts, counts = _fronts(azimuths, ranges)
    found: list[Base] = []
    left = np.ones(len(chosen), dtype=bool)  # points that belong to no thing yet
    order = np.argsort(fronts)
    open_columns = _in_groups_of(columns, fronts, counts, points.across, rules.points)
    for nearest in order:
        if not open_columns[nearest] or len(found) >= _MOST:
            continue
        front = fronts[nearest]
        gap = points.across / front
        base = _extent(columns, nearest, fronts <= front * (1.0 + rules.jump), gap)
        low, high = _extent(columns, nearest, np.abs(columns - np.clip(columns, *base)) < rules.beside / front, gap)
        own = left & (azimuths >= low) & (azimuths < high)
        open_columns &= (columns < low) | (columns >= high)
        left &= ~own
        thing = _thing(points, azimuths[own], ranges[own], weights[own], rules)
        if thing is not None and own.sum() >= rules.filled * _count(points, low, high, front, ranges[own].max()):
            azimuth, distance, width, confidence = thing
            found.append(Base(distance * points.directions(np.array(azimuth)), width, confidence))
    return sorted(found, key=lambda each: float(np.hypot(*each.position)))


def _count(points: GroundPoints, low: float, high: float, nearest: float, farthest: float) -> int:
    """Number of points between two azimuths [rad] and two ranges [m]."""
    first, last = np.searchsorted(points.ranges, nearest), np.searchsorted(points.ranges, farthest, side="right")
    part = slice(int(first), int(last))
    azimuths = points.azimuths[part]
    return int(np.count_nonzero((azimuths >= low) & (azimuths < high)))


def _fronts(azimuths: Floats, ranges: Floats) -> tuple[Floats, Floats, Chosen]:
    """Left edges [rad] of the columns that have points, the nearest range [m] and the number of points in each."""
    numbers = np.floor(azimuths / _COLUMN).astype(np.int16)
    order = np.argsort(numbers, kind="stable")  # from near to far in each column, as the points are
    starts = np.flatnonzero(np.diff(numbers[order], prepend=numbers.min() - 1))
    counts = np.diff(np.append(starts, len(order)))
    return np.asarray(numbers[order][starts] * _COLUMN), ranges[order][starts], counts


def _in_groups_of(columns: Floats, fronts: Floats, counts: Chosen, across: float, least: int) -> Mask:
    """Which columns are in groups, without gaps, of at least so many points: single points are not worth a search."""
    gaps = np.diff(columns) > _COLUMN + 1.6 * across / np.minimum(fronts[1:], fronts[:-1])
    group = np.concatenate([[0], np.cumsum(gaps)])
    return np.asarray(np.bincount(group, counts)[group] >= least)


def _extent(columns: Floats, number: int, allowed: Mask, gap: float) -> tuple[float, float]:
    """The directions [rad] between which allowed columns lie around that of a number, without gaps."""
    near = np.flatnonzero(allowed)
    at = int(np.searchsorted(near, number))
    wide = np.flatnonzero(np.diff(columns[near]) > _COLUMN + 1.6 * gap)
    first = wide[wide < at].max(initial=-1) + 1
    last = wide[wide >= at].min(initial=len(near) - 1)
    return float(columns[near[first]]), float(columns[near[last]]) + _COLUMN


def _thing(
    points: GroundPoints, azimuths: Floats, ranges: Floats, weights: Singles, rules: UprightRules
) -> tuple[float, float, float, float] | None:
    """Azimuth [rad], range [m], width [m] and confidence of a thing with these points, or None if it is none."""
    if len(ranges) < rules.points:
        return None
    front = float(ranges.min())
    # It is between this ring and the next nearer one.
    front = max(front - 0.5 * float(points.along(np.array(front))), 1e-3)
    heights = points.height * (1.0 - front / ranges)  # of the points, at the distance of the front
    tall = float(heights.max())
    low = heights <= max(rules.foot * tall, float(heights.min()) + 1e-9)
    azimuth = 0.5 * float(azimuths[low].min() + azimuths[low].max())
    width = float(np.ptp(azimuths)) * front + points.across
    if tall < rules.taller * min(width, 0.3) or width > rules.widest:
        return None
    return azimuth, front + rules.depth * width, width, float(weights.mean())
