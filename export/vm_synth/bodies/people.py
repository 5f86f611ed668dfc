"""People on the field: shoes, legs or whole people. They face +x."""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats

from .paints import Paint, black, cloth, gray, skin, vivid, white
from .primitives import capsule, rod, rounded_box, sphere
from .solids import Body, Solid, rotation, standing


def shoe(random: np.random.Generator, upper: Paint, sole: Paint, lace: Paint) -> list[Solid]:
    """A shoe of length 1 on z = 0, with its toes at +x and its ankle above the origin."""
    toe = sphere(0.17, 14).stretched(1.5, 1.0, 0.75).shifted((0.5, 0.0, 0.13))
    middle = sphere(0.2, 14).stretched(1.9, 0.85, 0.8).shifted((0.22, 0.0, 0.16))
    heel = sphere(0.16, 14).stretched(1.0, 0.95, 1.2).shifted((-0.06, 0.0, 0.18))
    collar = rod((-0.02, 0.0, 0.2), (-0.03, 0.0, 0.36), 0.14, 0.125, 12)
    base = rounded_box(0.98, 0.33, 0.09, 0.04).shifted((0.25, 0.0, 0.045))
    front = random.uniform() < 0.4
    parts = [each.painted(upper) for each in (middle, heel, collar)]
    parts += [toe.painted(sole if front else upper), base.painted(sole)]
    for k in range(4):
        x, z = 0.12 + 0.08 * k, 0.345 - 0.035 * k
        parts.append(capsule((x, -0.07, z), (x, 0.07, z), 0.018, segments=6).painted(lace))
    # A stripe on both sides.
    for side in (-1.0, 1.0):
        parts.append(capsule((0.18, side * 0.165, 0.12), (0.28, side * 0.135, 0.26), 0.02, segments=6).painted(lace))
    return parts


def shoes(random: np.random.Generator, size: float) -> list[Body]:
    """A shoe of this length [m] or, more often, a pair."""
    paints = _shoe_paints(random)
    count = 2 if random.uniform() < 0.7 else 1
    parts: list[Solid] = []
    for k in range(count):
        turn = rotation(yaw=random.normal(0.0, 0.25))
        place = (random.normal(0.0, 0.15), 0.45 * k + random.uniform(0.0, 0.15), 0.0)
        parts += [each.turned(turn).shifted(place) for each in shoe(random, *paints)]
    return [standing(parts, "environment", "shoes").stretched(size, size, size)]


def legs(random: np.random.Generator, height: float) -> list[Body]:
    """The legs, up to the waist, of a standing or walking person of this height [m]."""
    parts, _ = _legs(random)
    return [standing(parts, "environment", "legs").stretched(height, height, height)]


def person(random: np.random.Generator, height: float) -> list[Body]:
    """A standing or walking person of this height [m]."""
    parts, waist = _legs(random)
    shirt, tone, hair = cloth(random), skin(random), (black, gray)[random.integers(2)](random)
    lean = rotation(pitch=random.uniform(-0.05, 0.3))
    chest = rounded_box(0.13, 0.23, 0.31, 0.06).shifted((0.0, 0.0, 0.15)).painted(shirt)
    neck = rod((0.0, 0.0, 0.28), (0.005, 0.0, 0.36), 0.032).painted(tone)
    head = sphere(0.06, 16).stretched(1.05, 0.85, 1.25).shifted((0.02, 0.0, 0.4)).painted(tone)
    crown = sphere(0.062, 14).stretched(1.05, 0.9, 1.1).shifted((0.005, 0.0, 0.42)).painted(hair)
    parts += [each.turned(lean).shifted(waist) for each in (chest, neck, head, crown)]
    sleeve = shirt if random.uniform() < 0.5 else tone
    for side in (-1.0, 1.0):
        shoulder = lean @ np.array([0.0, side * 0.125, 0.25]) + waist
        swing = random.uniform(-0.4, 0.5)
        elbow = shoulder + 0.17 * np.array([np.sin(swing), side * 0.15, -np.cos(swing)])
        bend = swing + random.uniform(0.1, 1.2)
        hand = elbow + 0.15 * np.array([np.sin(bend), 0.0, -np.cos(bend)])
        parts += [
            capsule(shoulder, elbow, 0.034, 0.027).painted(shirt),
            capsule(elbow, hand, 0.026, 0.019).painted(sleeve),
            sphere(0.028, 10).stretched(1.0, 0.6, 1.4).shifted(hand).painted(tone),
        ]
    return [standing(parts, "environment", "person").stretched(height, height, height)]


def _legs(random: np.random.Generator) -> tuple[list[Solid], Floats]:
    """Legs of a person of height 1, and the position (3,) of the waist. The origin is between the hips."""
    trousers, tone, sock = cloth(random), skin(random), (white, black, vivid)[random.integers(3)](random)
    shorts = random.uniform() < 0.35
    paints = _shoe_paints(random)
    stride = random.uniform(0.0, 0.5) * random.choice([-1.0, 1.0])
    pelvis = rounded_box(0.11, 0.19, 0.12, 0.05).shifted((0.0, 0.0, 0.03)).painted(trousers)
    parts = [pelvis]
    for side in (-1.0, 1.0):
        angle = side * stride
        hip = np.array([0.0, side * 0.05, 0.0])
        knee = hip + 0.24 * _hanging(angle)
        # Only the rear leg is bent.
        ankle = knee + 0.24 * _hanging(angle - (0.1 if angle > 0.0 else random.uniform(0.1, 0.7)))
        calf = knee + 0.5 * (ankle - knee)
        if shorts:
            hem = hip + 0.7 * (knee - hip)
            parts += [
                rod(hip, hem, 0.055, 0.058, 14).painted(trousers),
                capsule(hip, knee, 0.045, 0.033, 12).painted(tone),
                capsule(knee, ankle, 0.034, 0.022, 12).painted(tone),
                capsule(calf, ankle, 0.0345, 0.025, 12).painted(sock),
            ]
        else:
            parts += [
                capsule(hip, knee, 0.054, 0.042, 14).painted(trousers).stained(random, 0.3, 0.05),
                capsule(knee, ankle, 0.042, 0.036, 14).painted(trousers).stained(random, 0.3, 0.05),
                rod(ankle, np.add(ankle, (0.0, 0.0, -0.02)), 0.038, 0.04, 14).painted(trousers),
            ]
        tilt = rotation(pitch=max(-angle, 0.0) * 0.8, yaw=side * 0.15)
        foot = (each.stretched(0.16, 0.16, 0.16).shifted((0.0, 0.0, -0.058)) for each in shoe(random, *paints))
        parts += [each.turned(tilt).shifted(ankle) for each in foot]
    return parts, np.array([0.0, 0.0, 0.06])


def _hanging(forward: float) -> Floats:
    return np.array([np.sin(forward), 0.0, -np.cos(forward)])


def _shoe_paints(random: np.random.Generator) -> tuple[Paint, Paint, Paint]:
    """Paints of the upper, the sole and the laces of a shoe."""
    upper = (white, white, black, gray, vivid, vivid)[random.integers(6)](random)
    sole = (white, white, black, vivid)[random.integers(4)](random)
    return upper, sole, (white, black, vivid)[random.integers(3)](random)
