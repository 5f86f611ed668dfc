"""Crossings: where two straight lines meet at a right angle, and in which shape."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..arrays import Floats, Mask
from .features import Crossing, Segment

_MARGIN = 0.25
"""A line that goes on by less than this behind a crossing [m] ends there."""

_MISSING = 0.35
"""A line may end so far in front of a crossing [m]."""

_LARGER = 0.05
"""Both grow by this share of the distance."""

_LEAST_SINE = 0.9
"""Sine of the angle between two lines that cross, at least."""

Shown = Callable[[Floats], Mask]
"""Which places (n, 2) [m] on the plane the frame shows."""


def find_crossings(lines: Sequence[Segment], shown: Shown) -> tuple[Crossing, ...]:
    """Crossings of all pairs of lines. Where the frame ends behind a line's end, the kind is unknown: no crossing."""
    if len(lines) < 2:
        return ()
    starts = np.array([each.ends[0] for each in lines])
    lengths = np.array([each.length for each in lines])
    ways = (np.array([each.ends[1] for each in lines]) - starts) / lengths[:, None]
    sine = _cross(ways[:, None], ways)
    sine[np.abs(sine) < _LEAST_SINE] = np.nan
    along = _cross(starts - starts[:, None], ways) / sine  # (n, n): where line i meets line j, [m] from its start
    places = starts[:, None] + along[..., None] * ways[:, None]
    larger = _LARGER * np.hypot(places[..., 0], places[..., 1])
    near = _MISSING + larger
    meets = (along > -near) & (along < lengths[:, None] + near)
    pairs = np.argwhere(np.triu(meets & meets.T, 1))
    found, behind = [], []
    for i, j in pairs:
        beyond = _MARGIN + larger[i, j]
        arms = [_arms(along[i, j], lengths[i], ways[i], beyond), _arms(along[j, i], lengths[j], ways[j], beyond)]
        if all(arms):
            found.append((places[i, j], arms))
            behind.append([places[i, j] - (own[0] if len(own) == 1 else 0.0 * own[0]) * beyond for own in arms])
    if not found:
        return ()
    complete: Mask = np.all(shown(np.array(behind).reshape(-1, 2)).reshape(-1, 2), axis=1)
    return tuple(_described(*each) for each, whole in zip(found, complete, strict=True) if whole)


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _arms(t: float, length: float, way: Floats, beyond: float) -> list[Floats]:
    """The directions in which a line goes on from a crossing at t [m] along it, by more than `beyond` [m]."""
    return [sign * way for sign, rest in ((1.0, length - t), (-1.0, t)) if rest > beyond]


def _described(place: Floats, arms: list[list[Floats]]) -> Crossing:
    counts = [len(each) for each in arms]
    if counts == [2, 2]:
        return Crossing("X", place, _angle(arms[0][0]) % (0.5 * np.pi))
    if counts == [1, 1]:
        return Crossing("L", place, _angle(arms[0][0] + arms[1][0]))
    return Crossing("T", place, _angle(arms[counts.index(1)][0]))


def _angle(direction: Floats) -> float:
    return float(np.arctan2(direction[1], direction[0]))
