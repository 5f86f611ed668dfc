"""Goals: posts, crossbar, back frame and net."""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats

from .paints import Paint, hued, metal, white
from .primitives import beam, cords, rod
from .solids import Body, Point, Solid, body, distance

_NET_SHARE = 0.6
_SQUARE_SHARE = 0.15


def goal(random: np.random.Generator, width: float, height: float, depth: float) -> list[Body]:
    """A goal that opens to +x, with posts at x = 0.

    width: between the posts [m]. height: below the crossbar [m]. depth: behind the posts [m]. Posts and crossbar are of
    class goal, back frame and net of class environment.
    """
    thickness = random.uniform(0.10, 0.12)
    paint = _goal_paint(random)
    square = random.uniform() < _SQUARE_SHARE

    def bar(start: Point, end: Point) -> Solid:
        return beam(start, end, thickness, thickness) if square else rod(start, end, thickness / 2.0, segments=16)

    side, top = (width + thickness) / 2.0, height + thickness / 2.0
    front = [bar((0.0, y, 0.0), (0.0, y, top)) for y in (-side, side)]
    front.append(bar((0.0, -side - thickness / 2.0, top), (0.0, side + thickness / 2.0, top)))
    bodies = [body([each.painted(paint).stained(random, 0.12, 0.3) for each in front], "goal", "goal")]
    thin = random.uniform(0.01, 0.03)
    frame_paint = paint if random.uniform() < 0.5 else metal(random)
    # The top of the back is as deep as its foot, less deep, or without a roof.
    roof = depth * random.choice([0.0, 0.4, 1.0])
    frame = []
    for y in (-side, side):
        frame += [((0.0, y, thin), (-depth, y, thin)), ((-depth, y, thin), (-roof, y, top))]
        frame += [((-roof, y, top), (0.0, y, top))] if roof else []
    frame += [((-depth, -side, thin), (-depth, side, thin)), ((-roof, -side, top), (-roof, side, top))]
    bodies.append(
        body([rod(a, b, thin, segments=8).painted(frame_paint) for a, b in frame], "environment", "goal frame")
    )
    if random.uniform() < _NET_SHARE:
        bodies.append(_net(random, side, top, depth, roof))
    return bodies


def _goal_paint(random: np.random.Generator) -> Paint:
    kind = random.choice(3, p=[0.76, 0.14, 0.1])
    if kind == 0:
        return white(random)
    hue = random.uniform(0.11, 0.15) if kind == 1 else random.uniform(0.54, 0.62)
    return hued(hue, random.uniform(0.5, 0.95), random.uniform(0.3, 0.85), random.uniform(0.2, 0.8))


def _net(random: np.random.Generator, side: float, top: float, depth: float, roof: float) -> Body:
    """A slightly sagging net over the back, the roof and both sides."""
    spacing = random.uniform(0.10, 0.18)
    radius = random.uniform(0.0015, 0.004)
    paint = white(random) if random.uniform() < 0.8 else hued(random.uniform(), 0.5, 0.2, 0.9)
    sag = random.uniform(0.0, 0.08)
    ground, ridge, bar, foot = (
        np.array([x, 0.0, z]) for x, z in ((-depth, 0.01), (-roof, top), (0.0, top), (0.0, 0.01))
    )
    left, right = np.array([0.0, -side, 0.0]), np.array([0.0, side, 0.0])
    panels = [_panel(ground + left, ridge + left, ground + right, ridge + right, spacing)]
    if roof:
        panels.append(_panel(ridge + left, bar + left, ridge + right, bar + right, spacing))
    panels += [_panel(ground + edge, ridge + edge, foot + edge, bar + edge, spacing) for edge in (left, right)]
    points = np.concatenate(panels)
    points[..., 0] += sag * np.sin(np.pi * points[..., 2] / top) * (points[..., 0] < -sag)
    return body([cords(points, radius, sides=3).painted(paint)], "environment", "goal net")


def _panel(a: Floats, b: Floats, c: Floats, d: Floats, spacing: float) -> Floats:
    """Strands (n, 5, 3) [m] of a net between the edges a-b and c-d, in both directions."""

    def strands(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
        count = max(int(distance(a + b, c + d) / 2.0 / spacing), 2)
        lows, highs = (np.linspace(start, end, count + 1) for start, end in ((a, c), (b, d)))
        apart = (lows != highs).any(axis=1)
        return np.linspace(lows[apart], highs[apart], 5, axis=1)

    return np.concatenate([strands(a, b, c, d), strands(a, c, b, d)])
