"""The objects to detect: solids of a given radius and height, and meshes of the user, in random colors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from vm_embedded.arrays import Floats, Singles

from .paints import Paint, black, common, gray, vivid, white
from .primitives import box, lathe
from .solids import Body, Solid, body, rotation, waves

_SEGMENTS, _STEPS = 40, 20
"""Vertices around and along an object: they hold its colors."""


def cup(random: np.random.Generator) -> Solid:
    """An open cup, slightly narrower at its foot."""
    foot, wall = random.uniform(0.7, 1.0), random.uniform(0.03, 0.08)
    profile = [(0.0, 0.0), *_line((foot, 0.0), (1.0, 1.0)), (1.0 - wall, 1.0), (foot - wall, wall), (0.0, wall)]
    return lathe(profile, _SEGMENTS)


def cylinder(random: np.random.Generator) -> Solid:
    """A closed cylinder: a can, a tin."""
    return lathe([(0.0, 0.0), *_line((1.0, 0.0), (1.0, 1.0)), (0.0, 1.0)], _SEGMENTS)


def cone(random: np.random.Generator) -> Solid:
    """A cone with a blunt tip, sometimes on a flat foot."""
    tip = random.uniform(0.02, 0.15)
    foot = random.uniform(0.6, 0.8) if random.random() < 0.5 else 1.0
    plate = [(1.0, 0.0), (1.0, 0.04), (foot, 0.04)] if foot < 1.0 else []
    return lathe([(0.0, 0.0), *plate, *_line((foot, 0.04 * (foot < 1.0)), (tip, 1.0)), (0.0, 1.0)], _SEGMENTS)


def square_box(random: np.random.Generator) -> Solid:
    """An upright box with a square base, whose corners are at the radius."""
    side = float(np.sqrt(2.0))
    return box(side, side, 1.0).shifted((0.0, 0.0, 0.5))


TARGETS: dict[str, Callable[[np.random.Generator], Solid]] = {
    "cup": cup,
    "cylinder": cylinder,
    "cone": cone,
    "box": square_box,
}
"""Objects by name: functions that draw one of radius 1 and height 1 on z = 0."""


def draw_target(
    random: np.random.Generator, solid: Solid, radius: float, height: float, textures: Sequence[Singles], name: str
) -> Body:
    """A solid of radius 1 and height 1 as the object to detect, in this size [m], turned and colored at random.

    textures: pictures (h, w, 3) of linear albedo that are wrapped around it; without any, it gets random paints.
    """
    colored = _textured(solid, textures[int(random.integers(len(textures)))]) if textures else _painted(random, solid)
    sized = colored.turned(rotation(yaw=random.uniform(-np.pi, np.pi))).stretched(radius, radius, height)
    return body([sized], "ball", name)


def unit_sized(solid: Solid) -> Solid:
    """The solid scaled to radius 1 around the vertical through its middle, and to height 1 on z = 0."""
    low, high = solid.low, solid.high
    middle = (low + high) / 2.0
    placed = solid.shifted((-middle[0], -middle[1], -low[2]))
    radius = float(np.hypot(placed.vertices[:, 0], placed.vertices[:, 1]).max())
    return placed.stretched(1.0 / radius, 1.0 / radius, 1.0 / float(high[2] - low[2]))


def _painted(random: np.random.Generator, solid: Solid) -> Solid:
    """One paint, often with bands, checks or blotches of a second one."""
    around, up = _unrolled(solid.vertices)
    whole = solid.painted(common(random))
    second: Paint = (white, black, gray, vivid, vivid, common)[random.integers(6)](random)
    kind = random.integers(6)
    if kind == 0:
        low = random.uniform(0.0, 0.8)
        whole = whole.painted(second, (up > low) & (up < low + random.uniform(0.1, 0.5)))
    elif kind == 1:
        whole = whole.painted(second, np.sin(up * random.uniform(6.0, 30.0) + random.uniform(0.0, 6.3)) > 0.0)
    elif kind == 2:
        checks = np.sin(around * 2.0 * np.pi * random.integers(2, 7)) * np.sin(up * random.uniform(6.0, 20.0))
        whole = whole.painted(second, checks > 0.0)
    elif kind == 3:
        whole = whole.painted(second, waves(random, solid.vertices, random.uniform(0.6, 2.0)) > 0.2)
    return whole.stained(random, random.uniform(0.0, 0.3), random.uniform(0.5, 2.0))


def _textured(solid: Solid, texture: Singles) -> Solid:
    """The colors of a picture (h, w, 3) that is wrapped once around the solid."""
    around, up = _unrolled(solid.vertices)
    height, width = texture.shape[:2]
    rows = np.clip((1.0 - up) * height, 0, height - 1).astype(np.intp)
    columns = np.clip(around * width, 0, width - 1).astype(np.intp)
    return replace(solid, colors=np.ascontiguousarray(texture[rows, columns], dtype=np.float32))


def _unrolled(vertices: Singles) -> tuple[Floats, Floats]:
    """Places of vertices (n, 3) around and along the vertical axis, each (n,) from 0 to 1."""
    around = np.arctan2(vertices[:, 1], vertices[:, 0]) / (2.0 * np.pi) % 1.0
    return around.astype(np.float64), np.clip(vertices[:, 2], 0.0, 1.0).astype(np.float64)


def _line(start: tuple[float, float], end: tuple[float, float]) -> list[tuple[float, float]]:
    """Points from start to end, enough for the colors between them."""
    steps = np.linspace(start, end, _STEPS + 1)
    return [(float(r), float(z)) for r, z in steps]
