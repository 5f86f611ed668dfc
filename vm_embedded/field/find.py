"""From classified points to field features: all steps in order."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..arrays import Floats, Singles
from .border import find_border
from .circle import CirclePoints, find_circle
from .crossings import certain_crossings, possible_crossings
from .features import Border, CenterCircle, FieldFeatures, Segment, Upright
from .ground_points import GroundPoints, starts_of_runs
from .lines import LEAST, LinePoints, Piece, find_pieces, line_points
from .ridges import Profiles, pieces_on_ridges

_WIDTHS = (1.2, 3.4)
"""Smallest and largest distance of a goal's posts [m]: from children's robots to those of adult size."""

ToPixels = Callable[[Floats], Floats]
"""Pixels (n, 2) of places (n, 2) [m] on the plane; NaN outside of the picture."""

_LONG = 2.0
"""Straight pieces from this length [m] are lines, also if they touch the center circle."""

_LIKELY = 0.2
"""Probability of a line from which a point may suggest a circle."""

_CELL = 0.1
"""At most one line point is reported in each square of this size [m]."""


def find_features(
    points: GroundPoints,
    to_pixels: ToPixels,
    profiles: Profiles,
    posts: tuple[Upright, ...],
    robots: tuple[Upright, ...],
) -> FieldFeatures:
    """All field features among the points of a frame.

    profiles: brightness of the frame across lines. posts, robots: what stands on the plane.
    """
    near = line_points(points)
    likely = near.part((near.weights > LEAST).nonzero()[0])
    pieces, circle = _straight_and_round(near, likely)
    pieces, ridges = pieces_on_ridges(pieces, points, profiles)
    confidences = [float(likely.weights.take(each.members).sum()) / len(each.members) for each in pieces]
    crossings = possible_crossings(pieces, confidences)
    behind = np.array([each for _, *both in crossings for each in both], dtype=np.complex128)
    border = find_border(points)
    ends = np.array([each.ends for each in pieces]).reshape(-1, 2)
    places = np.concatenate([ends, border, behind.view(np.float64).reshape(-1, 2)])
    pixels = to_pixels(places)  # faster at once
    shown = np.isfinite(pixels[len(ends) + len(border) :, 0]).reshape(-1, 2).tolist()
    lines = tuple(map(Segment, ends.reshape(-1, 2, 2), pixels[: len(ends)].reshape(-1, 2, 2), confidences))
    thinned, likelihoods = _thinned(likely)
    return FieldFeatures(
        posts=posts,
        goals=pair_posts(posts),
        robots=robots,
        lines=lines,
        circle=None if circle is None else _circle(circle, likely),
        crossings=certain_crossings([each for each, *_ in crossings], [one and other for one, other in shown]),
        line_points=thinned,
        line_confidences=likelihoods,
        border=Border(border, pixels[len(ends) : len(ends) + len(border)]) if len(border) else None,
        ridges=ridges,
    )


def _straight_and_round(points: LinePoints, likely: LinePoints) -> tuple[list[Piece], CirclePoints | None]:
    """Straight pieces and the center circle. A short piece that shares most points with the circle is part of it."""
    pieces = find_pieces(points, likely)
    free = likely.weights > _LIKELY
    for each in pieces:
        if each.length >= _LONG:
            free[each.members] = False
    circle = find_circle(likely, np.flatnonzero(free))
    if circle is not None:
        on = np.zeros(len(likely), dtype=bool)
        on[circle.members] = True
        pieces = [each for each in pieces if each.length >= 2.0 * circle.radius or on[each.members].mean() < 0.5]
    return pieces, circle


def _circle(circle: CirclePoints, points: LinePoints) -> CenterCircle:
    confidence = float(points.weights[circle.members].mean())
    return CenterCircle(circle.center, circle.radius, 2.0 * np.pi * circle.arc, confidence)


def _thinned(points: LinePoints) -> tuple[Floats, Singles]:
    """Mean places (p, 2) [m] and probabilities (p,) of the line points in each square."""
    if not len(points):
        return np.empty((0, 2)), np.empty(0, np.float32)
    cells = np.array([1024.0, 1.0]) @ np.floor(points.positions * (1.0 / _CELL))  # those of a square are the same
    order = cells.argsort()
    columns = np.array([*points.positions, points.weights, np.ones(len(points))]).take(order, axis=1)
    sums = np.add.reduceat(columns, starts_of_runs(cells.take(order)), axis=1)
    x, y, weights = sums[:3] / sums[3]
    return np.array([x, y]).T, weights.astype(np.float32)


def pair_posts(posts: Sequence[Upright]) -> tuple[tuple[int, int], ...]:
    """Indices of the left and right post of each goal, narrowest first; each post belongs to one goal at most."""
    pairs = []
    for number, one in enumerate(posts):
        for before in range(number):
            apart = float(np.hypot(*(one.position - posts[before].position)))
            if _WIDTHS[0] <= apart <= _WIDTHS[1]:
                pairs.append((apart, before, number))
    found: list[tuple[int, int]] = []
    taken: set[int] = set()
    for _, first, second in sorted(pairs):
        if not taken & {first, second}:
            taken |= {first, second}
            (x, y), (u, v) = posts[first].position, posts[second].position
            found.append((first, second) if u * y - v * x > 0.0 else (second, first))
    return tuple(found)
