"""Robots of the leagues with wheels: a large, mostly black box, as high as a table. They face +x."""

from __future__ import annotations

import numpy as np

from .paints import Paint, black, glass, gray, metal, team, vivid, white
from .primitives import axle, beam, box, cord, cylinder, dome, prism, rounded_box
from .solids import Body, Solid, merged, rotation, standing


def boxy_robot(random: np.random.Generator, height: float) -> list[Body]:
    """A box on wheels of this height [m] with a bumper, arms for the ball, labels, and often a mast for a camera."""
    cover = (black, black, black, gray, white, metal)[random.integers(6)](random)
    trim = (black, black, gray, team)[random.integers(4)](random)
    wide, corners = random.uniform(0.5, 0.75), int(random.choice([3, 4, 4, 6, 8, 24]))
    gap, top = random.uniform(0.03, 0.1), random.uniform(0.55, 1.0)
    waist = random.uniform(gap + 0.1, top - 0.05)
    taper = random.uniform(0.55, 1.0, 3).cumprod()
    half = 0.5 * wide
    upper = cover if random.uniform() < 0.7 else (black, gray, vivid)[random.integers(3)](random)
    bumper = prism(corners, 0.53 * wide, 0.53 * wide, random.uniform(0.04, 0.1))
    parts = [
        prism(corners, half, half * taper[0], waist - gap).shifted((0.0, 0.0, gap)).painted(cover),
        prism(corners, half * taper[1], half * taper[2], top - waist).shifted((0.0, 0.0, waist)).painted(upper),
        bumper.shifted((0.0, 0.0, gap)).painted(trim),
    ]
    parts = [each.stained(random, 0.15, 0.3) for each in parts]
    parts += _wheels(random, corners, wide)
    parts += _arms(random, wide, gap, trim)
    parts += _labels(random, corners, (half, half * taper[0]), (gap, waist))
    if top < 0.9:
        parts += _mast(random, wide * taper[2], top, trim)
    whole = standing(parts, "robot", "boxy robot")
    factor = height / float(whole.high[2])
    return [whole.stretched(factor, factor, factor)]


def _wheels(random: np.random.Generator, corners: int, wide: float) -> list[Solid]:
    """Wheels below the corners."""
    count = 3 if corners in (3, 6) else 4
    radius = random.uniform(0.05, 0.09)
    tire, hub = black(random), metal(random)
    parts = []
    for k in range(count):
        turn = rotation(yaw=2.0 * np.pi * (k + 0.5) / count)
        wheel = merged(
            [axle((0.0, 0.0, 0.0), radius, 0.04).painted(tire), axle((0.0, 0.0, 0.0), 0.5 * radius, 0.05).painted(hub)]
        )
        parts.append(wheel.turned(rotation(yaw=np.pi / 2.0)).shifted((0.38 * wide, 0.0, radius)).turned(turn))
    return parts


def _arms(random: np.random.Generator, wide: float, gap: float, trim: Paint) -> list[Solid]:
    """Two arms with rollers that hold the ball in front."""
    if random.uniform() < 0.3:
        return []
    aside, reach = random.uniform(0.1, 0.16), random.uniform(0.02, 0.1)
    front = 0.42 * wide
    parts = []
    for side in (-1.0, 1.0):
        start, end = (front, side * aside * 1.3, gap + 0.16), (front + reach, side * aside, gap + 0.1)
        parts += [
            beam(start, end, 0.02, 0.03).painted(trim),
            axle(end, 0.025, 0.03).painted(vivid(random)),
        ]
    return parts


def _labels(
    random: np.random.Generator, corners: int, halves: tuple[float, float], levels: tuple[float, float]
) -> list[Solid]:
    """Plates, lamps and numbers on the sides of a prism with these distances of its corners from the axis, between
    these heights, below and above."""
    parts = []
    for side in range(corners):
        if random.uniform() < 0.5:
            share = random.uniform(0.2, 0.8)
            out = (halves[0] + share * (halves[1] - halves[0])) * np.cos(np.pi / corners)
            wide = 2.0 * out * np.tan(np.pi / corners)
            tall = levels[1] - levels[0]
            lean = np.arctan2((halves[0] - halves[1]) * np.cos(np.pi / corners), tall)
            paint = (team, white, vivid)[random.integers(3)](random)
            plate = box(0.012, random.uniform(0.1, 0.6) * wide, random.uniform(0.1, 0.35) * tall).painted(paint)
            place = (out, random.uniform(-0.15, 0.15) * wide, levels[0] + share * tall)
            parts.append(
                plate.turned(rotation(pitch=-lean)).shifted(place).turned(rotation(yaw=2.0 * np.pi * side / corners))
            )
    return parts


def _mast(random: np.random.Generator, wide: float, top: float, trim: Paint) -> list[Solid]:
    """A mast with a camera below a mirror, a plate or a handle, up to the height 1."""
    kind = random.integers(3)
    if kind == 0:
        glassy = glass(random)
        tube = cylinder(0.045, 0.9 - top, 14).shifted((0.0, 0.0, 0.5 * (top + 0.9)))
        mirror = dome(0.07, 0.1, 14).turned(rotation(roll=np.pi)).shifted((0.0, 0.0, 1.0))
        return [tube.painted(glassy if random.uniform() < 0.5 else trim), mirror.painted(metal(random))]
    if kind == 1:
        post = box(0.04, 0.04, 1.0 - top).shifted((-0.2 * wide, 0.0, 0.5 * (1.0 + top)))
        head = rounded_box(0.1, 0.16, 0.08, 0.01).shifted((-0.2 * wide, 0.0, 0.96))
        return [post.painted(metal(random)), head.painted((black, gray)[random.integers(2)](random))]
    angle = np.linspace(0.0, np.pi, 9)
    arch = np.stack([np.zeros(9), 0.35 * wide * np.cos(angle), top + (0.98 - top) * np.sin(angle)], axis=1)
    return [cord(arch, 0.02).painted(metal(random))]
