"""From classified points to field features, in one straight line."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Floats
from .border import find_border
from .circle import CirclePoints, find_circle
from .crossings import find_crossings
from .features import Border, CenterCircle, FieldFeatures, Segment, Upright
from .goals import pair_posts
from .ground_points import GroundPoints
from .lines import LinePoints, Piece, find_pieces, line_points
from .uprights import POST, ROBOT, Base, find_uprights

ToPixels = Callable[[Floats], Floats]
"""Pixels (n, 2) of places (n, 2) [m] on the plane; NaN where the lens does not see them."""

_LONG = 1.2
"""Straight pieces from this length [m] are lines, also if they touch the center circle."""

_CELL = 0.1
"""At most one line point is reported in each square of this size [m]."""


def find_features(points: GroundPoints, to_pixels: ToPixels) -> FieldFeatures:
    """All field features among the points of a frame."""
    posts = tuple(_uprights(points, "goal", to_pixels))
    robots = tuple(_uprights(points, "robot", to_pixels))
    lines: tuple[Segment, ...] = ()
    circle, places, confidences = None, np.empty((0, 2)), np.empty(0, np.float32)
    if "line" in points.classes:
        candidates = line_points(points)
        pieces, round_one = _straight_and_round(candidates)
        lines = tuple(_segment(each, candidates, to_pixels) for each in pieces)
        circle = None if round_one is None else _circle(round_one, candidates)
        places, confidences = _thinned(candidates)
    border = find_border(points) if "field" in points.classes else np.empty((0, 2))
    return FieldFeatures(
        posts=posts,
        goals=pair_posts(posts),
        robots=robots,
        lines=lines,
        circle=circle,
        crossings=tuple(find_crossings(lines, lambda place: bool(np.isfinite(to_pixels(place[None])).all()))),
        line_points=places,
        line_confidences=confidences,
        border=Border(border, to_pixels(border)) if len(border) else None,
    )


def _uprights(points: GroundPoints, name: str, to_pixels: ToPixels) -> list[Upright]:
    if name not in points.classes:
        return []
    bases = find_uprights(points, points.classes[name], POST if name == "goal" else ROBOT)
    return [_upright(each, name, points.height, to_pixels) for each in bases]


def _upright(base: Base, name: str, height: float, to_pixels: ToPixels) -> Upright:
    toward = np.array([*base.position, -height])
    distance = float(np.linalg.norm(toward))
    pixel = to_pixels(base.position[None])[0]
    return Upright(name, base.position, distance, toward / distance, pixel, base.width, base.confidence)


def _straight_and_round(points: LinePoints) -> tuple[list[Piece], CirclePoints | None]:
    """Straight pieces and the center circle. A short piece that shares most points with the circle is part of it."""
    pieces = find_pieces(points)
    free = np.ones(len(points), dtype=bool)
    for each in pieces:
        if each.length >= _LONG:
            free[each.members] = False
    circle = find_circle(points, np.flatnonzero(free))
    if circle is not None:
        on = np.zeros(len(points), dtype=bool)
        on[circle.members] = True
        pieces = [each for each in pieces if each.length >= 2.0 * circle.radius or on[each.members].mean() < 0.5]
    return pieces, circle


def _segment(piece: Piece, points: LinePoints, to_pixels: ToPixels) -> Segment:
    return Segment(piece.ends, to_pixels(piece.ends), float(points.weights[piece.members].mean()))


def _circle(circle: CirclePoints, points: LinePoints) -> CenterCircle:
    confidence = float(points.weights[circle.members].mean())
    return CenterCircle(circle.center, circle.radius, 2.0 * np.pi * circle.arc, confidence)


def _thinned(points: LinePoints) -> tuple[Floats, Floats]:
    """Mean places (p, 2) [m] and probabilities (p,) of the line points in each square."""
    if not len(points):
        return np.empty((0, 2)), np.empty(0, np.float32)
    cells = np.floor(points.positions / _CELL).astype(np.int64)
    _, number, count = np.unique(cells[:, 0] * (1 << 20) + cells[:, 1], return_inverse=True, return_counts=True)
    sums = [np.bincount(number, each) / count for each in (*points.positions.T, points.weights)]
    return np.stack(sums[:2], axis=1), sums[2].astype(np.float32)
