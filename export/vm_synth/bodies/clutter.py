"""Objects around a field. Each is drawn around the origin with the length of its longest side [m].

The module is long because it holds 14 kinds of objects; each is a short function of its own.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .paints import black, common, glass, gray, hued, metal, team, vivid, white, wood
from .primitives import beam, box, capsule, cord, cylinder, lathe, rod, rounded_box, sheet, sphere
from .solids import Body, DrawBody, Solid, rotation, sized, standing


def carton(random: np.random.Generator, size: float) -> list[Body]:
    """A box of cardboard or painted, sometimes with a label and tape."""
    x, y, z = random.uniform(0.35, 1.0, 3)
    parts = [box(x, y, z).painted(common(random)).stained(random, 0.25, 0.5)]
    if random.uniform() < 0.5:
        parts.append(box(x * 0.5, y * 1.006, z * 0.4).shifted((0.0, 0.0, z * 0.15)).painted(common(random)))
    if random.uniform() < 0.4:
        parts.append(box(0.12, y * 1.004, z * 1.004).painted(wood(random)))
    return _to_body(parts, size, "box")


def can(random: np.random.Generator, size: float) -> list[Body]:
    """A can, a roll or a cup, upright or on its side."""
    radius, kind = random.uniform(0.2, 0.45), random.integers(3)
    if kind == 0:
        profile = [(0.0, 0.0), (radius * 0.85, 0.0), (radius, 0.06), (radius, 0.92), (radius * 0.85, 1.0), (0.0, 0.97)]
        parts = [
            lathe(profile, 20).painted(metal(random)),
            lathe([(radius * 1.005, 0.08), (radius * 1.005, 0.9)], 20).painted(vivid(random)),
            lathe([(radius * 1.01, 0.3), (radius * 1.01, 0.6)], 20).painted(common(random)),
        ]
    elif kind == 1:
        parts = [cylinder(radius, 1.0, 20).painted(common(random))]
    else:
        parts = [_cup(radius * 0.8, radius, 1.0).painted(common(random)).stained(random, 0.2, 0.4)]
    return _to_body(_tipped(random, parts, 0.3), size, "can")


def bottle(random: np.random.Generator, size: float) -> list[Body]:
    """A bottle with a cap and a label, upright or on its side."""
    r = random.uniform(0.11, 0.18)
    shape = [
        (0.0, 0.0),
        (r * 0.9, 0.0),
        (r, 0.03),
        (r, 0.58),
        (r * 0.85, 0.68),
        (0.05, 0.85),
        (0.05, 0.92),
        (0.0, 0.92),
    ]
    paint = (white, gray, vivid, glass)[random.integers(4)](random)
    parts = [
        lathe(shape, 18).painted(paint),
        lathe([(r * 1.01, 0.2), (r * 1.01, 0.5)], 18).painted(common(random)),
        cylinder(0.06, 0.09, 12).shifted((0.0, 0.0, 0.955)).painted(common(random)),
    ]
    return _to_body(_tipped(random, parts, 0.4), size, "bottle")


def cone(random: np.random.Generator, size: float) -> list[Body]:
    """A traffic cone with bands, or a flat training cone."""
    paint, band = hued(random.choice([0.03, 0.05, 0.15, random.uniform()]), 0.9, 0.7, 0.6), white(random)
    foot = random.uniform(0.24, 0.5)
    tip = foot * random.uniform(0.1, 0.25)
    parts = [box(foot * 2.4, foot * 2.4, 0.05).shifted((0.0, 0.0, 0.025))] if random.uniform() < 0.7 else []
    parts.append(cylinder(foot, 1.0, 20, tip).shifted((0.0, 0.0, 0.5)))
    parts = [each.painted(paint) for each in parts]
    for low in (0.3, 0.6)[: int(random.integers(0, 3))]:
        a, b = (1.02 * (foot + (tip - foot) * z) for z in (low, low + 0.18))
        parts.append(lathe([(a, low), (b, low + 0.18)], 20).painted(band))
    return _to_body(parts, size, "cone")


def bucket(random: np.random.Generator, size: float) -> list[Body]:
    """A bucket or a bin with a handle."""
    top = random.uniform(0.35, 0.55)
    parts = [_cup(top * random.uniform(0.65, 0.95), top, 1.0, 0.03).painted(common(random))]
    angle = np.linspace(0.0, np.pi, 9)
    drop = random.choice([-1.0, 1.0]) * 0.5
    arch = np.stack([drop * np.sin(angle) * top * 1.6, np.cos(angle) * top, 0.95 - 0.15 * np.sin(angle)], axis=1)
    arch[:, 0] = np.clip(arch[:, 0], -top * 1.1, top * 1.1)
    parts.append(cord(arch, 0.015).painted(metal(random)))
    return _to_body(parts, size, "bucket")


def bag(random: np.random.Generator, size: float) -> list[Body]:
    """A backpack or a sports bag with straps and a pocket."""
    x, y, z = random.uniform(0.3, 0.5), random.uniform(0.6, 1.0), random.uniform(0.4, 0.8)
    paint, trim = common(random), black(random)
    parts = [
        rounded_box(x, y, z, x * 0.4).painted(paint).stained(random, 0.3, 0.3),
        rounded_box(x * 0.5, y * 0.7, z * 0.5, x * 0.2).shifted((x * 0.4, 0.0, -z * 0.15)).painted(paint),
        box(0.01, y * 0.6, 0.02).shifted((x * 0.65, 0.0, 0.0)).painted(trim),
    ]
    angle = np.linspace(0.0, np.pi, 8)
    for side in (-0.2, 0.2):
        loop = np.stack([np.full(8, 0.0), side + 0.12 * np.cos(angle), z / 2.0 + 0.15 * np.sin(angle)], axis=1)
        parts.append(cord(loop, 0.015).painted(trim))
    return _to_body(parts, size, "bag")


def tool(random: np.random.Generator, size: float) -> list[Body]:
    """A small device of rods, boxes and knobs: a charger, a screwdriver, a toy."""
    parts: list[Solid] = []
    for _ in range(int(random.integers(2, 6))):
        place = random.uniform(-0.15, 0.15, 3)
        kind = random.integers(4)
        if kind == 0:
            part = rounded_box(*_two(random, 0.1, 0.5), random.uniform(0.1, 0.5), 0.04)
        elif kind == 1:
            part = sphere(random.uniform(0.06, 0.2), 12)
        elif kind == 2:
            part = capsule((0.0, 0.0, 0.0), random.uniform(-0.5, 0.5, 3), random.uniform(0.02, 0.1))
        else:
            part = cylinder(random.uniform(0.05, 0.25), random.uniform(0.05, 0.4), 14)
        parts.append(part.turned(rotation(*random.uniform(0.0, 6.3, 3))).shifted(place).painted(common(random)))
    return _to_body(parts, size, "tool")


def paper(random: np.random.Generator, size: float) -> list[Body]:
    """A flat sheet on the ground: paper or ragged cloth, sometimes printed."""
    if random.uniform() < 0.6:
        half = np.array([1.0, random.uniform(0.4, 1.0)]) / 2.0
        outline = half * [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
    else:
        angle = np.linspace(0.0, 2.0 * np.pi, 18, endpoint=False)
        outline = np.stack([np.cos(angle), np.sin(angle)], axis=1) * random.uniform(0.3, 0.5, (18, 1))
    parts = [sheet(outline, 0.003).painted((white, white, common)[random.integers(3)](random))]
    for _ in range(int(random.integers(0, 4))):
        print_ = box(*_two(random, 0.05, 0.3), 0.004).shifted((*random.uniform(-0.15, 0.15, 2), 0.002))
        parts.append(print_.painted((black, vivid, gray)[random.integers(3)](random)))
    return _to_body(parts, size, "paper")


def tape(random: np.random.Generator, size: float) -> list[Body]:
    """Tape on the ground: a stripe, a cross or a corner."""
    paint, width = (white, white, black, vivid)[random.integers(4)](random), random.uniform(0.05, 0.2)
    stripe = box(1.0, width, 0.003).shifted((0.0, 0.0, 0.0015))
    kind = random.integers(3)
    parts = [stripe]
    if kind > 0:
        turned = box(width, random.uniform(0.5, 1.0), 0.003).shifted((0.0, 0.0, 0.002))
        parts.append(turned if kind == 1 else turned.shifted((0.5 - width / 2.0, -turned.low[1], 0.0)))
    return _to_body([each.painted(paint) for each in parts], size, "tape")


def cable(random: np.random.Generator, size: float) -> list[Body]:
    """A winding cable on the ground."""
    t, thickness = np.linspace(0.0, 1.0, 50), random.uniform(0.004, 0.012)
    waver = [
        sum(random.normal(0.0, 0.35 / k) * np.sin(k * np.pi * t + random.uniform(0.0, 6.3)) for k in (1, 2, 3))
        for _ in "xy"
    ]
    points = np.stack([t + waver[0], waver[1], np.full_like(t, thickness)], axis=1)
    return _to_body(
        [cord(points, thickness).painted((black, black, gray, white, vivid)[random.integers(5)](random))], size, "cable"
    )


def table(random: np.random.Generator, size: float) -> list[Body]:
    """A table: a top on four legs."""
    x, y, z = 1.0, random.uniform(0.5, 0.9), random.uniform(0.5, 0.7)
    top = box(x, y, 0.03).shifted((0.0, 0.0, z)).painted((wood, white, gray)[random.integers(3)](random))
    leg = metal(random)
    feet = [(a * (x / 2.0 - 0.04), b * (y / 2.0 - 0.04)) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    return _to_body([top, *(rod((*at, 0.0), (*at, z), 0.02).painted(leg) for at in feet)], size, "table")


def chair(random: np.random.Generator, size: float) -> list[Body]:
    """A chair with four legs and a back."""
    seat, leg = common(random), metal(random)
    parts = [
        rounded_box(0.45, 0.45, 0.04, 0.018).shifted((0.0, 0.0, 0.46)).painted(seat),
        rounded_box(0.03, 0.45, 0.3, 0.014).shifted((-0.23, 0.0, 0.8)).painted(seat),
    ]
    for a, b in ((a, b) for a in (-1.0, 1.0) for b in (-1.0, 1.0)):
        parts.append(rod((a * 0.24, b * 0.23, 0.0), (a * 0.2, b * 0.2, 0.46), 0.013).painted(leg))
    parts += [rod((-0.2, b * 0.2, 0.44), (-0.23, b * 0.2, 0.9), 0.013).painted(leg) for b in (-1.0, 1.0)]
    return _to_body(parts, size, "chair")


def pole(random: np.random.Generator, size: float) -> list[Body]:
    """A post, a flagpole or a lamp stand on a foot."""
    radius = random.uniform(0.008, 0.04)
    paint, foot = (white, metal, black, vivid)[random.integers(4)](random), common(random)
    parts = [cylinder(radius * random.uniform(2.0, 5.0), 0.03, 18).shifted((0.0, 0.0, 0.015)).painted(foot)]
    steps = int(random.integers(1, 6))
    second = white(random) if random.uniform() < 0.5 else paint
    for k in range(steps):
        rung = rod((0.0, 0.0, k / steps), (0.0, 0.0, (k + 1) / steps), radius, segments=14)
        parts.append(rung.painted(second if k % 2 else paint))
    if random.uniform() < 0.3:
        parts.append(box(0.005, 0.3, 0.2).shifted((0.0, 0.15, 0.9)).painted(team(random)))
    return _to_body(parts, size, "pole")


def board(random: np.random.Generator, size: float) -> list[Body]:
    """A wall or an advertising board along y, with colored fields on its front at +x."""
    tall = random.uniform(0.15, 0.5)
    parts = [box(0.02, 1.0, tall).painted(common(random))]
    for k in range(int(random.integers(0, 12))):
        y, z = random.uniform(0.02, 0.3), random.uniform(0.05, 0.8) * tall
        place = (0.01 + 0.0002 * k, random.uniform(-0.5, 0.5) * (1.0 - y), random.uniform(-0.5, 0.5) * (tall - z))
        field = (
            box(0.001, y, z)
            if random.uniform() < 0.7
            else cylinder(z / 2.0, 0.001, 20).turned(rotation(pitch=np.pi / 2.0))
        )
        parts.append(field.shifted(place).painted((white, common, vivid)[random.integers(3)](random)))
    return _to_body(parts, size, "board")


def pedestal(random: np.random.Generator, height: float, width: float) -> list[Body]:
    """A pedestal for a ball. Its flat top is at this height [m] and `width` wide [m], centered on the z axis."""
    kind = random.integers(4)
    if kind == 0:
        parts = [box(width, width * random.uniform(1.0, 1.6), height)]
    elif kind == 1:
        parts = [cylinder(width / 2.0 * random.uniform(1.0, 1.5), height, 28, width / 2.0)]
    elif kind == 2:
        slab = 0.2 * height
        parts = [rod((0.0, 0.0, 0.0), (0.0, 0.0, height - slab), 0.2 * width, segments=16)]
        parts.append(cylinder(width / 2.0, slab, 28).shifted((0.0, 0.0, height - slab / 2.0)))
        parts.append(cylinder(0.4 * width, 0.2 * slab, 24).shifted((0.0, 0.0, 0.1 * slab)))
    else:
        parts = [
            beam(
                (a * 0.4 * width, b * 0.4 * width, 0.0),
                (a * 0.4 * width, b * 0.4 * width, 0.85 * height),
                0.08 * width,
                0.08 * width,
            )
            for a in (-1.0, 1.0)
            for b in (-1.0, 1.0)
        ]
        parts.append(box(width, width, 0.15 * height).shifted((0.0, 0.0, 0.925 * height)))
    paint = common(random)
    return [standing([each.painted(paint).stained(random, 0.15, width) for each in parts], "environment", "pedestal")]


CLUTTER: dict[str, DrawBody] = {
    "box": carton,
    "can": can,
    "bottle": bottle,
    "cone": cone,
    "bucket": bucket,
    "bag": bag,
    "tool": tool,
    "paper": paper,
    "tape": tape,
    "cable": cable,
}
"""Small objects (5 to 50 cm) by name."""

FURNITURE: dict[str, DrawBody] = {"table": table, "chair": chair, "pole": pole, "board": board}
"""Large objects by name."""


def _to_body(parts: Iterable[Solid], size: float, name: str) -> list[Body]:
    """A body of class environment on the plane, scaled to this size [m]."""
    return [sized(standing(parts, "environment", name), size)]


def _two(random: np.random.Generator, low: float, high: float) -> tuple[float, float]:
    return random.uniform(low, high), random.uniform(low, high)


def _cup(foot: float, rim: float, height: float, wall: float = 0.02) -> Solid:
    """An open cup on z = 0."""
    inside = [(rim - wall, height), (foot - wall, wall), (0.0, wall)]
    return lathe([(0.0, 0.0), (foot, 0.0), (rim, height), *inside], 22)


def _tipped(random: np.random.Generator, parts: list[Solid], chance: float) -> list[Solid]:
    """The parts, put on their side with this probability."""
    turn = rotation(pitch=np.pi / 2.0) if random.uniform() < chance else rotation()
    return [each.turned(turn) for each in parts]
