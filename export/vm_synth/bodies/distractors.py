"""Round objects that are not the ball. Each is drawn with a radius [m]: half of its longest side."""

from __future__ import annotations

import numpy as np

from .paints import Paint, black, common, gray, hued, skin, vivid, white
from .primitives import dome, icosphere, lathe, rod, sphere, torus
from .solids import Body, DrawBody, Solid, rotation, sized, standing, waves


def plain_ball(random: np.random.Generator, radius: float) -> list[Body]:
    """A sphere of one saturated color: orange, tennis yellow or any."""
    hues = (0.05, 0.19, random.uniform())
    paint = hued(
        hues[random.integers(3)], random.uniform(0.7, 0.97), random.uniform(0.3, 0.8), random.uniform(0.1, 0.9)
    )
    return _round([sphere(1.0, 28).painted(paint).stained(random, 0.2, 0.5)], radius, "plain ball")


def patterned_ball(random: np.random.Generator, radius: float) -> list[Body]:
    """A sphere with stripes, panels or spots in saturated colors."""
    ball = icosphere(1.0, 4).painted(vivid(random))
    second = (vivid, vivid, black, white)[random.integers(4)](random)
    points = ball.vertices.astype(np.float64)
    kind = random.integers(3)
    if kind == 0:
        chosen = np.sin(random.uniform(4.0, 12.0) * points[:, 2]) > random.uniform(-0.2, 0.5)
    elif kind == 1:
        chosen = np.sin(random.integers(2, 5) * np.arctan2(points[:, 1], points[:, 0])) > 0.0
    else:
        chosen = waves(random, ball.vertices, 1.2) > 0.1
    return _round([ball.painted(second, chosen).turned(_any_turn(random))], radius, "patterned ball")


def white_sphere(random: np.random.Generator, radius: float) -> list[Body]:
    """A white or gray sphere without a pattern. Draw it with a radius that the ball does not have."""
    paint = (white, white, gray)[random.integers(3)](random)
    return _round([sphere(1.0, 28).painted(paint).stained(random, 0.15, 0.6)], radius, "white sphere")


def half_dome(random: np.random.Generator, radius: float) -> list[Body]:
    """A dome on the ground: a lamp, a lid, a training marker."""
    cap = dome(1.0, random.uniform(0.2, 0.85), 24)
    return _round([cap.painted((white, white, gray, vivid)[random.integers(4)](random))], radius, "dome")


def white_disc(random: np.random.Generator, radius: float) -> list[Body]:
    """A flat disc with a rim, sometimes with spots: a paper plate, a lid, a piece of tape."""
    height = random.uniform(0.01, 0.08)
    profile = [(0.0, 0.0), (0.9, 0.0), (1.0, height), (0.85, height * 1.1), (0.75, height * 0.6), (0.0, height * 0.6)]
    plate = lathe(profile, 32).painted((white, white, white, gray, vivid)[random.integers(5)](random))
    parts = [plate]
    for _ in range(int(random.integers(0, 4))):
        spot = lathe([(0.2, 0.0), (0.2, height * 0.65), (0.0, height * 0.65)], 12)
        away = random.uniform(-0.4, 0.4, 2)
        parts.append(spot.shifted((*away, 0.0)).painted((black, black, vivid)[random.integers(3)](random)))
    return _round(parts, radius, "disc")


def ring(random: np.random.Generator, radius: float) -> list[Body]:
    """A ring, lying or standing: tape, a hoop, a wheel."""
    thickness = random.uniform(0.12, 0.7)
    if random.uniform() < 0.4:
        inner, height = 1.0 - thickness, random.uniform(0.2, 0.9)
        profile = [(inner, 0.0), (1.0, 0.0), (1.0, height), (inner, height), (inner, 0.0)]
        hoop = lathe(profile, 32)
    else:
        hoop = torus(1.0 - thickness / 2.0, thickness)
    hoop = hoop.painted(common(random))
    if random.uniform() < 0.3:
        hoop = hoop.turned(rotation(roll=np.pi / 2.0 - 0.1, yaw=random.uniform(0.0, 6.3)))
    return _round([hoop], radius, "ring")


def egg(random: np.random.Generator, radius: float) -> list[Body]:
    """An egg or a rugby ball on its side."""
    long = random.uniform(1.3, 1.8)
    shell = sphere(1.0, 24).stretched(1.0, 1.0, long)
    taper = 1.0 - random.uniform(0.0, 0.25) * shell.vertices[:, 2:] / long
    shape = Solid(
        shell.vertices * np.concatenate([taper, taper, np.ones_like(taper)], axis=1).astype(np.float32),
        shell.normals,
        shell.triangles,
        shell.colors,
        shell.roughness,
    )
    lying = shape.turned(rotation(pitch=np.pi / 2.0 + random.normal(0.0, 0.15)))
    return _round([lying.painted(_shell_paint(random)).stained(random, 0.2, 0.5)], radius, "egg")


def deflated(random: np.random.Generator, radius: float) -> list[Body]:
    """A deflated ball with a dent on top."""
    dent = random.uniform(0.1, 0.5)
    profile = [(0.0, 0.0), (0.7, 0.02), (0.95, 0.2), (1.0, 0.4), (0.9, 0.65), (0.65, 0.75), (0.35, 0.75 - dent)]
    ball = lathe([*profile, (0.0, 0.7 - dent)], 28).painted(_shell_paint(random))
    dark = waves(random, ball.vertices, 1.0) > 0.2
    ball = ball.painted((black, vivid)[random.integers(2)](random), dark) if random.uniform() < 0.6 else ball
    return _round([ball.turned(rotation(*random.normal(0.0, 0.12, 2)))], radius, "deflated ball")


def balloon(random: np.random.Generator, radius: float) -> list[Body]:
    """A balloon or a lamp: a sphere with a neck, on its side."""
    paint = (white, vivid, vivid)[random.integers(3)](random)
    parts = [sphere(0.75, 24).stretched(1.0, 1.0, 1.15), rod((0.0, 0.0, -0.8), (0.0, 0.0, -1.1), 0.3, 0.2, 16)]
    neck = paint if random.uniform() < 0.5 else gray(random)
    lying = [parts[0].painted(paint), parts[1].painted(neck)]
    turn = rotation(pitch=random.uniform(1.0, 2.0))
    return _round([each.turned(turn) for each in lying], radius, "balloon")


DISTRACTORS: dict[str, DrawBody] = {
    "plain_ball": plain_ball,
    "patterned_ball": patterned_ball,
    "white_sphere": white_sphere,
    "dome": half_dome,
    "disc": white_disc,
    "ring": ring,
    "egg": egg,
    "deflated": deflated,
    "balloon": balloon,
}
"""Round objects by name: functions of (random, radius [m])."""


def _round(parts: list[Solid], radius: float, name: str) -> list[Body]:
    return [sized(standing(parts, "environment", name), 2.0 * radius)]


def _shell_paint(random: np.random.Generator) -> Paint:
    return (white, white, gray, vivid, skin)[random.integers(5)](random)


def _any_turn(random: np.random.Generator) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return rotation(*random.uniform(0.0, 2.0 * np.pi, 3))
