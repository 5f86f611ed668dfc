"""From classified points to field features: all steps in order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..arrays import Floats, Singles
from .border import find_border
from .circle import CirclePoints, find_circle
from .crossings import find_crossings
from .features import Border, CenterCircle, FieldFeatures, Segment, Upright
from .ground_points import GroundPoints, starts_of_runs
from .lines import LEAST, LinePoints, Piece, find_pieces, line_points
from .ridges import Profiles, pieces_on_ridges
from .uprights import KINDS, POST, ROBOT, Base, UprightRules, find_uprights

ToPixels = Callable[[Floats], Floats]
"""Pixels (n, 2) of places (n, 2) [m] on the plane; NaN outside of the picture."""

_LONG = 2.0
"""Straight pieces from this length [m] are lines, also if they touch the center circle."""

_LIKELY = 0.2
"""Probability of a line from which a point may suggest a circle."""

_CELL = 0.1
"""At most one line point is reported in each square of this size [m]."""


def find_features(
    points: GroundPoints, to_pixels: ToPixels, profiles: Profiles, bases: Mapping[str, Sequence[Base]]
) -> FieldFeatures:
    """All field features among the points of a frame.

    profiles: brightness of the frame across lines. bases: of the classes that have peaks or a close look, by class.
    Rules find the uprights of the others.
    """
    found = {
        name: bases[name] if name in bases else _by_rules(points, name, rules)
        for name, rules in (("goal", POST), ("robot", ROBOT))
    }
    near = line_points(points)
    likely = near.part(np.flatnonzero(near.weights > LEAST))
    pieces, circle = _straight_and_round(near, likely)
    pieces, ridges = pieces_on_ridges(pieces, points, profiles)
    border = find_border(points) if "field" in points.classes else np.empty((0, 2))
    feet = {name: np.array([each.position for each in things]).reshape(-1, 2) for name, things in found.items()}
    ends = np.array([each.ends for each in pieces]).reshape(-1, 2)
    post_pixels, robot_pixels, end_pixels, border_pixels = _all_pixels(
        to_pixels, feet["goal"], feet["robot"], ends, border
    )
    posts = _uprights(found["goal"], KINDS["goal"], points.height, post_pixels)
    lines = tuple(
        Segment(piece.ends, pixels, float(likely.weights[piece.members].sum()) / len(piece.members))
        for piece, pixels in zip(pieces, end_pixels.reshape(-1, 2, 2), strict=True)
    )
    thinned, confidences = _thinned(likely)
    return FieldFeatures(
        posts=posts,
        goals=pair_posts(posts),
        robots=_uprights(found["robot"], KINDS["robot"], points.height, robot_pixels),
        lines=lines,
        circle=None if circle is None else _circle(circle, likely),
        crossings=find_crossings(lines, lambda places: np.asarray(np.isfinite(to_pixels(places)).all(axis=1))),
        line_points=thinned,
        line_confidences=confidences,
        border=Border(border, border_pixels) if len(border) else None,
        ridges=ridges,
    )


def _by_rules(points: GroundPoints, name: str, rules: UprightRules) -> list[Base]:
    return find_uprights(points, points.classes[name], rules) if name in points.classes else []


def _all_pixels(to_pixels: ToPixels, *groups: Floats) -> list[Floats]:
    """The pixels of groups of places (n, 2) [m]. One call for all costs less than one for each."""
    return np.split(to_pixels(np.concatenate(groups)), np.cumsum([len(each) for each in groups])[:-1])


def _uprights(bases: Sequence[Base], name: str, height: float, pixels: Floats) -> tuple[Upright, ...]:
    return tuple(_upright(base, name, height, pixel) for base, pixel in zip(bases, pixels, strict=True))


def _upright(base: Base, name: str, height: float, pixel: Floats) -> Upright:
    toward = np.array([*base.position, -height])
    distance = float(np.linalg.norm(toward))
    return Upright(name, base.confidence, base.position, distance, toward / distance, pixel, base.width)


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
    cells = np.floor(points.positions * (1.0 / _CELL)) @ (1024.0, 1.0)  # points of a square have the same number
    order = np.argsort(cells)
    starts = starts_of_runs(cells[order])
    columns = np.array([*points.positions.T, points.weights])[:, order]
    x, y, weights = np.add.reduceat(columns, starts, axis=1) / np.diff(starts, append=len(order))
    return np.array([x, y]).T, weights.astype(np.float32)


_WIDTHS = (1.2, 3.4)
"""Smallest and largest distance of a goal's posts [m]: from children's robots to those of adult size."""


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
