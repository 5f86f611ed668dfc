"""The camera's carrier, as the camera sees it: a tripod, a robot's body, a hand, a pole or a person.

Frame: the origin is on the plane below the camera, which is at (0, 0, height); x is the camera's heading, y left, z up.
All parts stay away from the camera and, except for thin ones, well below the horizon.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .paints import black, cloth, glass, gray, metal, skin, white
from .people import shoe
from .primitives import axle, box, capsule, cylinder, rod, rounded_box, sphere
from .solids import Body, Point, Solid, along, body, rotation


def tripod(random: np.random.Generator, height: float) -> list[Solid]:
    """Three legs, a column and a head below the camera."""
    paint, joint = (black, gray, metal)[random.integers(3)](random), black(random)
    top = height - random.uniform(0.075, 0.12)
    hub = top - min(random.uniform(0.08, 0.3), 0.4 * top)
    thin, foot = random.uniform(0.008, 0.016), random.uniform(0.35, 0.6) * height
    plate = random.uniform(0.03, 0.06)
    parts = [
        box(plate, plate, 0.012).shifted((0.0, 0.0, top - 0.006)).painted(joint),
        rod((0.0, 0.0, hub), (0.0, 0.0, top - 0.006), 1.2 * thin).painted(metal(random)),
        cylinder(2.5 * thin, 0.05, 12).shifted((0.0, 0.0, hub)).painted(joint),
    ]
    if random.uniform() < 0.4 and top > 0.25:
        parts.append(rod((0.0, 0.0, top - 0.03), (-0.2, 0.04, top - 0.18), 0.008).painted(joint))
    first = random.uniform(0.0, 2.0 * np.pi)
    for k in range(3):
        way = np.array([np.cos(first + k * 2.0 * np.pi / 3.0), np.sin(first + k * 2.0 * np.pi / 3.0), 0.0])
        upper, lower = 0.03 * way + (0.0, 0.0, hub), foot * way + (0.0, 0.0, thin)
        middle = upper + 0.55 * (lower - upper)
        parts += [
            rod(upper, middle, 1.3 * thin).painted(paint),
            rod(middle, lower, 0.8 * thin).painted(metal(random)),
            capsule(middle + 0.02 * (upper - middle), middle, 1.6 * thin).painted(joint),
            sphere(thin, 8).shifted(lower).painted(joint),
        ]
    return parts


def robot(random: np.random.Generator, height: float) -> list[Solid]:
    """The body of a robot with the camera in its head."""
    shell, inner = (white, white, black, gray)[random.integers(4)](random), (black, gray)[random.integers(2)](random)
    h = height
    chest = h - max(0.16 * h, 0.11)
    back, wide = random.uniform(-0.1, -0.02) * h, random.uniform(0.11, 0.15) * h
    thick = random.uniform(0.06, 0.09) * h
    parts = [
        rounded_box(0.16 * h, 2.0 * wide, 0.3 * h, 0.05 * h).shifted((back, 0.0, chest - 0.17 * h)).painted(shell),
        capsule((back, 0.0, chest - 0.05 * h), (back, 0.0, chest), 0.03 * h).painted(inner),
    ]
    crouch = random.uniform(0.0, 0.14) * h
    for side in (-1.0, 1.0):
        shoulder = np.array([back, side * (wide + 0.5 * thick), chest - 0.09 * h])
        reach = random.uniform(-0.1, 0.7)
        elbow = shoulder + 0.17 * h * np.array([np.sin(reach), 0.2 * side, -np.cos(reach)])
        bend = min(reach + random.uniform(0.2, 1.5), 1.4)
        hand = elbow + 0.17 * h * np.array([np.sin(bend), -0.2 * side, -np.cos(bend)])
        ankle = np.array([back + random.uniform(-0.1, 0.1) * h, side * 0.08 * h, 0.06 * h])
        hip = np.array([back, side * 0.07 * h, 0.42 * h])
        knee = (hip + ankle) / 2.0 + (crouch, 0.0, 0.0)
        parts += [
            sphere(0.5 * thick, 12).shifted(shoulder).painted(inner),
            capsule(shoulder, elbow, 0.4 * thick).painted(shell),
            capsule(elbow, hand, 0.36 * thick, 0.3 * thick).painted(shell),
            sphere(0.35 * thick, 10).shifted(hand).painted(inner),
            capsule(hip, knee, 0.55 * thick).painted(shell),
            capsule(knee, ankle, 0.5 * thick).painted(shell),
            axle(knee, 0.55 * thick, thick).painted(inner),
            rounded_box(0.2 * h, 0.1 * h, 0.05 * h, 0.015 * h)
            .shifted(np.add(ankle, (0.04 * h, 0.0, -0.035 * h)))
            .painted(shell),
        ]
    return _turned(random, parts, 0.9)


def handheld(random: np.random.Generator, height: float) -> list[Solid]:
    """A hand and forearm that hold a phone, a tablet or a laptop in front of and below the camera."""
    width, deep = ((0.075, 0.155), (0.17, 0.24), (0.31, 0.22))[random.integers(3)]
    case, screen, tone, sleeve = (
        (black, gray, white, metal)[random.integers(4)](random),
        glass(random),
        skin(random),
        cloth(random),
    )
    below, ahead = 0.22 + 0.6 * deep, 0.16 + 0.4 * deep
    grip = -1.0 if random.uniform() < 0.75 else 1.0
    slab = [
        rounded_box(deep, width, 0.012, 0.005).painted(case),
        box(0.9 * deep, 0.93 * width, 0.001).shifted((0.0, 0.0, 0.0065)).painted(screen),
    ]
    edge = grip * (0.5 * width + 0.008)
    for k in range(4):
        x = -0.03 + 0.021 * k
        slab.append(capsule((x, edge, -0.015), (x, edge - grip * 0.025, 0.012), 0.009, 0.008).painted(tone))
    slab.append(capsule((-0.05, edge, -0.01), (-0.01, edge - grip * 0.04, 0.014), 0.011, 0.009).painted(tone))
    slab.append(sphere(0.04, 12).stretched(1.3, 1.0, 0.6).shifted((-0.02, edge, -0.03)).painted(tone))
    wrist, elbow = (-0.06, edge, -0.035), (-0.06 - 0.8 * ahead, edge + grip * 0.1, -0.16)
    slab += [
        capsule(wrist, elbow, 0.028, 0.04).painted(tone),
        capsule(elbow, np.add(elbow, (-0.05, 0.0, -0.2)), 0.055).painted(sleeve),
    ]
    tilt = rotation(random.normal(0.0, 0.1), random.uniform(-0.25, 0.05), random.normal(0.0, 0.15))
    parts = [each.turned(tilt).shifted((ahead, random.uniform(-0.06, 0.06), height - below)) for each in slab]
    return _turned(random, parts, 0.4)


def stick(random: np.random.Generator, height: float) -> list[Solid]:
    """A slanting pole below the camera, held by a hand or standing on the ground."""
    paint, joint = (black, metal, gray)[random.integers(3)](random), black(random)
    radius, top = random.uniform(0.006, 0.016), height - random.uniform(0.08, 0.12)
    bearing, slant = random.uniform(0.0, 2.0 * np.pi), random.uniform(0.0, 0.45)
    way = np.array([np.cos(bearing) * np.sin(slant), np.sin(bearing) * np.sin(slant), -np.cos(slant)])
    start = np.array([0.0, 0.0, top])
    long = min(random.uniform(0.5, 1.2), (top - radius) / float(np.cos(slant)) - radius)
    end = start + long * way
    parts = [rod(start, start + 0.3 * long * way, radius).painted(joint), rod(start, end, 0.7 * radius).painted(paint)]
    parts.append(cylinder(min(2.0 * radius, 0.03), 0.02, 12).shifted(start).painted(joint))
    if random.uniform() < 0.6 and long > 0.35:
        tone = skin(random)
        for k in range(4):
            knuckle = end - (0.03 + 0.022 * k) * way
            parts.append(
                axle((0.0, 0.0, 0.0), radius + 0.016, 0.02).turned(_upright(way)).shifted(knuckle).painted(tone)
            )
        wrist = end - 0.06 * way + (-0.05, 0.0, -0.03)
        parts.append(capsule(wrist, np.add(wrist, (-0.2, 0.0, -0.12)), 0.03, 0.04).painted(cloth(random)))
    return _above_plane(parts)


def person(random: np.random.Generator, height: float) -> list[Solid]:
    """The body of a person who carries the camera at the head or the chest."""
    shirt, trousers, tone = cloth(random), cloth(random), skin(random)
    paints = tuple((white, black, gray)[random.integers(3)](random) for _ in range(3))
    h = height
    back, top = random.uniform(-0.14, -0.06) * h, h - max(0.17 * h, 0.12)
    parts = [
        rounded_box(0.15 * h, 0.26 * h, 0.3 * h, 0.06 * h).shifted((back, 0.0, top - 0.15 * h)).painted(shirt),
        sphere(0.1 * h, 18).stretched(1.0, 1.2, 1.1).shifted((back + 0.03 * h, 0.0, top - 0.25 * h)).painted(shirt),
    ]
    parts = [each.stained(random, 0.3, 0.1 * h) for each in parts]
    for side in (-1.0, 1.0):
        shoulder = np.array([back, side * 0.14 * h, top - 0.06 * h])
        elbow = shoulder + 0.17 * h * np.array([random.uniform(-0.1, 0.4), 0.25 * side, -0.9])
        hand = elbow + 0.16 * h * np.array([random.uniform(0.1, 0.9), -0.4 * side, random.uniform(-0.8, -0.2)])
        hip, ankle = (
            np.array([back, side * 0.06 * h, 0.45 * h]),
            np.array([back + random.uniform(-0.1, 0.15) * h, side * 0.08 * h, 0.07 * h]),
        )
        foot = [
            each.stretched(0.16 * h, 0.16 * h, 0.16 * h).turned(rotation(yaw=side * random.uniform(0.0, 0.4)))
            for each in shoe(random, paints[0], paints[1], paints[2])
        ]
        parts += [
            capsule(shoulder, elbow, 0.038 * h, 0.03 * h, 14).painted(shirt),
            capsule(elbow, hand, 0.028 * h, 0.02 * h, 14).painted(tone),
            sphere(0.03 * h, 12).stretched(1.2, 0.8, 0.8).shifted(hand).painted(tone),
            capsule(hip, ankle, 0.06 * h, 0.035 * h, 14).painted(trousers),
            *(each.shifted((ankle[0], ankle[1], 0.0)) for each in foot),
        ]
    return _turned(random, parts, 0.7)


CARRIERS: dict[str, Callable[[np.random.Generator, float], list[Solid]]] = {
    "tripod": tripod,
    "robot": robot,
    "handheld": handheld,
    "stick": stick,
    "person": person,
}
"""Carriers by name: functions of (random, camera height [m]) that return the parts."""

LOWEST = {"tripod": 0.2, "robot": 0.3, "handheld": 0.5, "stick": 0.25, "person": 0.8}
"""Smallest camera height for each carrier [m]."""


def carriers_for(height: float) -> tuple[str, ...]:
    """Names of the carriers that can hold a camera at this height [m]."""
    return tuple(name for name, lowest in LOWEST.items() if height >= lowest)


def camera_carrier(random: np.random.Generator, height: float, kind: str) -> Body:
    """The carrier of a camera at this height [m]. kind: one of CARRIERS."""
    return body(_above_plane(CARRIERS[kind](random, height)), "environment", f"own {kind}")


def _turned(random: np.random.Generator, parts: list[Solid], spread: float) -> list[Solid]:
    """Parts rotated about the vertical, for a camera that does not look straight ahead."""
    yaw = rotation(yaw=random.normal(0.0, 0.5) * spread)
    return [each.turned(yaw) for each in parts]


def _above_plane(parts: list[Solid]) -> list[Solid]:
    """Parts, moved up if they reach below the plane."""
    return [each.shifted((0.0, 0.0, max(0.0, -each.low[2]))) for each in parts]


def _upright(way: Point) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Rotation (3, 3) that maps y to a direction (3,)."""
    return along((0.0, 0.0, 0.0), way) @ rotation(roll=np.pi / 2.0)
