"""Crossings: where two straight lines meet at a right angle, and in which shape."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..arrays import Floats
from .features import Crossing, Segment

_MARGIN = 0.25
"""A line that goes on by less than this behind a crossing [m] ends there."""

_MISSING = 0.35
"""A line may end so far in front of a crossing [m]."""

_LARGER = 0.05
"""Both grow by this share of the distance."""

_LEAST_SINE = 0.9
"""Sine of the angle between two lines that cross, at least."""

Shown = Callable[[Floats], bool]
"""Whether the frame shows a place (2,) [m] on the plane."""


def find_crossings(lines: Sequence[Segment], shown: Shown) -> list[Crossing]:
    """Crossings of all pairs of lines. Where the frame ends behind a line's end, the kind is unknown: no crossing."""
    found = []
    for number, one in enumerate(lines):
        for other in lines[number + 1 :]:
            crossing = _crossing(one, other, shown)
            if crossing is not None:
                found.append(crossing)
    return found


def _crossing(one: Segment, other: Segment, shown: Shown) -> Crossing | None:
    a, b = _direction(one), _direction(other)
    sine = a[0] * b[1] - a[1] * b[0]
    if abs(sine) < _LEAST_SINE:
        return None
    apart = other.ends[0] - one.ends[0]
    t, s = (apart[0] * b[1] - apart[1] * b[0]) / sine, (apart[0] * a[1] - apart[1] * a[0]) / sine
    place = one.ends[0] + t * a
    larger = _LARGER * float(np.hypot(*place))
    arms = _arms(t, one.length, larger), _arms(s, other.length, larger)
    if not all(arms):
        return None
    beyond = _MARGIN + larger
    for own, line in zip(arms, (a, b), strict=True):
        if len(own) == 1 and not shown(place - own[0] * line * beyond):
            return None
    return _described(place, [[each * line for each in own] for own, line in zip(arms, (a, b), strict=True)])


def _direction(line: Segment) -> Floats:
    along = line.ends[1] - line.ends[0]
    return np.asarray(along / np.hypot(*along))


def _arms(t: float, length: float, larger: float) -> list[float]:
    """Signs of the directions in which a line goes on from a crossing at t [m] along it; none if it does not meet it."""
    if not -_MISSING - larger < t < length + _MISSING + larger:
        return []
    return [sign for sign, rest in ((1.0, length - t), (-1.0, t)) if rest > _MARGIN + larger]


def _described(place: Floats, arms: list[list[Floats]]) -> Crossing:
    counts = [len(each) for each in arms]
    if counts == [2, 2]:
        return Crossing("X", place, _angle(arms[0][0]) % (0.5 * np.pi))
    if counts == [1, 1]:
        return Crossing("L", place, _angle(arms[0][0] + arms[1][0]))
    return Crossing("T", place, _angle(arms[counts.index(1)][0]))


def _angle(direction: Floats) -> float:
    return float(np.arctan2(direction[1], direction[0]))
