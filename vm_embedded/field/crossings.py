"""Crossings: where two straight lines meet at a right angle, and in which shape."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..arrays import Floats, Mask
from .features import Crossing, Segment
from .ground_points import cross

_MARGIN = 0.25
"""A line that goes on by less than this behind a crossing [m] ends there."""

_MISSING = 0.35
"""A line may end so far in front of a crossing [m]."""

_LARGER = 0.05
"""Both grow by this share of the distance."""

_LEAST_SINE = 0.9
"""Sine of the angle between two lines that cross, at least; cosine of the angle between two parallel ones."""

_GAP_COST = 0.5
"""Share of a crossing's confidence that is lost if a line ends as far in front of it as it may."""

Shown = Callable[[Floats], Mask]
"""Which places (n, 2) [m] on the plane the frame shows."""


def find_crossings(lines: Sequence[Segment], shown: Shown) -> tuple[Crossing, ...]:
    """Crossings of all pairs of lines. There is none where its kind is not clear: where the frame ends behind
    the end of a line, or where lines of several pieces meet."""
    if len(lines) < 2:
        return ()
    ends, confidences = _without_duplicates(lines)
    starts = ends[:, 0]
    lengths, ways = _lengths_and_ways(ends)
    sine = cross(ways[:, None], ways)
    sine[np.abs(sine) < _LEAST_SINE] = np.nan
    along = cross(starts - starts[:, None], ways) / sine  # (n, n): where line i meets line j, [m] from its start
    places = starts[:, None] + along[..., None] * ways[:, None]
    larger = _LARGER * np.hypot(places[..., 0], places[..., 1])
    near = _MISSING + larger
    gaps = np.maximum(-along, along - lengths[:, None]) / near  # of line i in front of line j
    meets = gaps < 1.0
    pairs = np.argwhere(np.triu(meets & meets.T, 1))
    found, behind = [], []  # behind: two places that the frame must show to be sure that a line ends
    for i, j in pairs:
        beyond = _MARGIN + larger[i, j]
        arms = [_arms(along[i, j], lengths[i], ways[i], beyond), _arms(along[j, i], lengths[j], ways[j], beyond)]
        if all(arms):
            gap = max(gaps[i, j], gaps[j, i], 0.0)
            found.append((places[i, j], arms, float(confidences[i] * confidences[j] * (1.0 - _GAP_COST * gap))))
            behind.append([places[i, j] - (own[0] * beyond if len(own) == 1 else 0.0) for own in arms])
    if not found:
        return ()
    complete: Mask = np.all(shown(np.array(behind).reshape(-1, 2)).reshape(-1, 2), axis=1)
    crossings = [_described(*each) for each, whole in zip(found, complete, strict=True) if whole]
    return tuple(each for each in crossings if _is_alone(each, crossings))


def _without_duplicates(lines: Sequence[Segment]) -> tuple[Floats, Floats]:
    """Ends (n, 2, 2) [m] and confidences (n,) of the lines, longest first.

    A line that was found twice, as two lines beside each other, is one: the longer, with the ends of both.
    """
    ordered = sorted(lines, key=lambda each: -each.length)
    ends, confidences = np.array([each.ends for each in ordered]), np.array([each.confidence for each in ordered])
    lengths, ways = _lengths_and_ways(ends)
    middles = ends.mean(axis=1)
    relative = ends - ends[:, None, None, 0]  # (n, n, 2, 2): ends of line j from the start of line i
    along = np.einsum("ijek,ik->ije", relative, ways)
    overlaps = (along.max(axis=2) > 0.0) & (along.min(axis=2) < lengths[:, None])
    off = np.abs(cross(ways[:, None], middles - ends[:, None, 0]))
    beside = off < _MARGIN + 0.5 * _LARGER * np.hypot(*middles.T)
    again = np.triu((np.abs(ways @ ways.T) > _LEAST_SINE) & overlaps & beside, 1)
    kept = np.ones(len(lines), dtype=bool)
    for i, j in np.argwhere(again):
        if kept[i] and kept[j]:
            kept[j] = False
            reach = (ends[i] - ends[i, 0]) @ ways[i], along[i, j]
            low, high = np.min(reach), np.max(reach)
            ends[i] = ends[i, 0] + np.outer([low, high], ways[i])
            along[i] -= low  # from the new start
    return ends[kept], confidences[kept]


def _lengths_and_ways(ends: Floats) -> tuple[Floats, Floats]:
    """Lengths (n,) [m] and directions (n, 2) of straight pieces with these ends (n, 2, 2) [m]."""
    steps = ends[:, 1] - ends[:, 0]
    lengths = np.hypot(*steps.T)
    return lengths, steps / lengths[:, None]


def _is_alone(crossing: Crossing, others: Sequence[Crossing]) -> bool:
    """Whether no other crossing is at the same place. Of a line in two pieces, each makes one, and none is right."""
    near = [np.hypot(*(each.position - crossing.position)) < 2.0 * _MARGIN for each in others]
    return bool(sum(near) == 1)


def _arms(t: float, length: float, way: Floats, beyond: float) -> list[Floats]:
    """The directions in which a line goes on from a crossing at t [m] along it, by more than `beyond` [m]."""
    return [sign * way for sign, rest in ((1.0, length - t), (-1.0, t)) if rest > beyond]


def _described(place: Floats, arms: list[list[Floats]], confidence: float) -> Crossing:
    counts = [len(each) for each in arms]
    if counts == [2, 2]:
        return Crossing("X", place, _angle(arms[0][0]) % (0.5 * np.pi), confidence)
    if counts == [1, 1]:
        return Crossing("L", place, _angle(arms[0][0] + arms[1][0]), confidence)
    return Crossing("T", place, _angle(arms[counts.index(1)][0]), confidence)


def _angle(direction: Floats) -> float:
    return float(np.arctan2(direction[1], direction[0]))
