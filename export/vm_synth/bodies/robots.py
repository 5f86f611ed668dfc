"""Robots on the field. They face +x with their hips or base above the origin.

The module is long because the humanoids share all their parts: legs, trunk, arms and heads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats

from .paints import Paint, black, glass, gray, metal, team, vivid, white
from .primitives import axle, beam, box, capsule, cylinder, dome, lathe, rod, rounded_box, sphere
from .solids import Body, Point, Solid, between, distance, merged, rotation, sized, standing

Limb = Callable[[Point, Point, float], Solid]
"""Makes a limb between two points with a thickness [m]."""

_NAO_HEIGHT = 0.58


@dataclass(frozen=True)
class Pose:
    """Joint angles of a humanoid [rad]; pairs are (right, left). Forward and outward are positive."""

    lean: float
    hips: tuple[float, float]
    spread: tuple[float, float]
    knees: tuple[float, float]
    shoulders: tuple[float, float]
    arms: tuple[float, float]
    elbows: tuple[float, float]
    head: tuple[float, float]


@dataclass(frozen=True)
class Build:
    """The build of a humanoid of height 1: half widths of hips and shoulders, thickness of limbs, and paints."""

    hips: float
    shoulders: float
    thickness: float
    limb: Limb
    shell: Paint
    inner: Paint
    torso: Paint
    marker: Paint


def humanoid(random: np.random.Generator, height: float) -> list[Body]:
    """A standing, walking or kicking humanoid robot; height: when upright [m]."""
    shell = (white, white, black, black, gray, metal)[random.integers(6)](random)
    limb = (_rods, _beams, _shells, _plates)[random.integers(4)]
    build = Build(
        hips=random.uniform(0.05, 0.08),
        shoulders=random.uniform(0.12, 0.16),
        thickness=random.uniform(0.055, 0.095),
        limb=limb,
        shell=shell,
        inner=(black, gray, metal)[random.integers(3)](random),
        torso=(team, vivid)[random.integers(2)](random) if random.uniform() < 0.45 else shell,
        marker=team(random),
    )
    pose = _pose(random)
    parts = [*_lower(build, pose), *_upper(build, pose), *_head(random, build, pose)]
    return [standing(parts, "robot", "humanoid").stretched(height, height, height)]


def nao(random: np.random.Generator, height: float = _NAO_HEIGHT) -> list[Body]:
    """A white and gray robot like a NAO. It is always 0.58 m tall; the height is ignored."""
    shell = white(random)
    jersey = team(random) if random.uniform() < 0.6 else shell
    build = Build(0.085, 0.16, 0.125, _rods, shell, gray(random), jersey, team(random))
    pose = _pose(random)
    top = _trunk(pose)[1]
    turned = rotation(pitch=pose.head[1], yaw=pose.head[0])
    eye, ear = glass(random), build.inner
    head = [sphere(0.085, 16).stretched(0.95, 1.2, 0.9).painted(shell)]
    head += [axle((0.0, y, 0.0), 0.055, 0.03).painted(ear) for y in (-0.1, 0.1)]
    head += [sphere(0.018, 8).shifted((0.07, y, 0.0)).painted(eye) for y in (-0.035, 0.035)]
    head += [sphere(0.015, 8).shifted((0.07, 0.0, z)).painted(eye) for z in (0.04, -0.04)]
    parts = [*_lower(build, pose), *_upper(build, pose)]
    parts += [each.turned(turned).shifted(np.add(top, (0.0, 0.0, 0.115))) for each in head]
    return [standing(parts, "robot", "nao").stretched(_NAO_HEIGHT, _NAO_HEIGHT, _NAO_HEIGHT)]


def fallen(random: np.random.Generator, height: float) -> list[Body]:
    """A humanoid robot that lies on its front, back or side; height: when upright [m]."""
    (robot,) = nao(random) if random.uniform() < 0.4 else humanoid(random, height)
    flat = robot.turned(rotation(pitch=random.choice([-1.0, 1.0]) * np.pi / 2.0))
    turned = flat.turned(rotation(roll=random.choice([0.0, 0.0, np.pi / 2.0])))
    middle = (turned.low + turned.high) / 2.0
    return [turned.shifted((-middle[0], -middle[1], -turned.low[2]))]


def wheeled_robot(random: np.random.Generator, height: float) -> list[Body]:
    """A wheeled robot of this height [m]: a round or square base with a tower or with team markers on top."""
    width = random.uniform(0.5, 0.85)
    wheel = random.uniform(0.08, 0.14)
    cover, inner = (black, white, gray, metal)[random.integers(4)](random), black(random)
    count = int(random.integers(3, 5))
    parts = []
    for k in range(count):
        yaw = 2.0 * np.pi * (k + 0.5) / count
        disk = axle((0.0, 0.0, 0.0), wheel, 0.06).painted(inner)
        hub = axle((0.0, 0.0, 0.0), wheel * 0.5, 0.07).painted(metal(random))
        turn = rotation(yaw=yaw - np.pi / 2.0)
        parts += [each.shifted((0.0, width * 0.47, wheel)).turned(turn) for each in (disk, hub)]
    floor, top = wheel * 0.6, random.uniform(0.3, 0.6)
    tall = top - floor
    if random.uniform() < 0.6:
        base = lathe([(0.0, 0.0), (0.48, 0.0), (0.5, 0.05), (0.5, tall - 0.03), (0.46, tall), (0.0, tall)], 24)
        base = base.stretched(width, width, 1.0).shifted((0.0, 0.0, floor))
    else:
        base = rounded_box(width, width, tall, 0.04).shifted((0.0, 0.0, floor + tall / 2.0))
    parts += [
        base.painted(cover),
        box(0.05, width * 0.4, 0.08).shifted((width * 0.5, 0.0, floor + 0.05)).painted(inner),
    ]
    if random.uniform() < 0.6:
        narrow = width * random.uniform(0.15, 0.4)
        tower = cylinder(narrow, 0.9 - top, 18, narrow * random.uniform(0.3, 1.0)).shifted(
            (0.0, 0.0, (top + 0.9) / 2.0)
        )
        camera = dome(0.1, 0.1, 14).shifted((0.0, 0.0, 0.9))
        parts += [
            tower.painted((cover, gray(random), metal(random))[random.integers(3)]),
            camera.painted(glass(random)),
        ]
    else:
        for k in range(5):
            yaw = 2.0 * np.pi * k / 5.0
            spot = cylinder(0.11 * width, 0.01, 14).shifted(
                (0.3 * width * np.cos(yaw) * (k > 0), 0.3 * width * np.sin(yaw) * (k > 0), top + 0.004)
            )
            parts.append(spot.painted(vivid(random)))
    side = axle((0.0, 0.0, 0.0), 0.06, 0.02).painted(team(random))
    parts += [side.shifted((0.0, 0.0, floor + 0.5 * tall)).shifted((0.0, s * width * 0.5, 0.0)) for s in (-1.0, 1.0)]
    whole = sized(standing(parts, "robot", "wheeled robot"), 1.0)
    factor = height / float(whole.high[2])
    return [whole.stretched(factor, factor, factor)]


def _pose(random: np.random.Generator) -> Pose:
    kind = random.choice(3, p=[0.35, 0.45, 0.2])
    bend = random.uniform(0.1, 0.6)
    stride = 0.0 if kind == 0 else random.uniform(0.1, 0.4) * random.choice([-1.0, 1.0])
    hips, knees = [bend + stride, bend - stride], [2.0 * bend, 2.0 * bend]
    lifted = int(random.integers(2))
    if kind == 1:
        knees[lifted] += random.uniform(0.0, 0.4)
    elif kind == 2:
        hips[lifted], knees[lifted] = random.uniform(0.5, 1.1), random.uniform(0.0, 0.6)
    swing = random.uniform(-0.3, 0.5)
    return Pose(
        lean=random.uniform(-0.05, 0.35),
        hips=(hips[0], hips[1]),
        spread=(random.uniform(0.0, 0.15), random.uniform(0.0, 0.15)),
        knees=(knees[0], knees[1]),
        shoulders=(swing + stride, swing - stride),
        arms=(random.uniform(0.05, 0.5), random.uniform(0.05, 0.5)),
        elbows=(random.uniform(0.0, 1.7), random.uniform(0.0, 1.7)),
        head=(random.uniform(-1.0, 1.0), random.uniform(0.0, 0.5)),
    )


def _lower(build: Build, pose: Pose) -> list[Solid]:
    """Legs and feet. The origin is between the hips."""
    thick = build.thickness
    parts = [rounded_box(1.3 * thick, 2.0 * build.hips + thick, thick, 0.3 * thick).painted(build.inner)]
    for k, side in enumerate((-1.0, 1.0)):
        hip = np.array([0.0, side * build.hips, 0.0])
        knee = hip + 0.23 * _downward(pose.hips[k], side * pose.spread[k])
        ankle = knee + 0.22 * _downward(pose.hips[k] - pose.knees[k], side * pose.spread[k])
        parts += [
            build.limb(hip, knee, thick).painted(build.shell),
            build.limb(knee, ankle, 0.85 * thick).painted(build.shell),
            axle(knee, 0.5 * thick, 0.9 * thick, 10).painted(build.inner),
            axle(ankle, 0.45 * thick, 0.8 * thick, 10).painted(build.inner),
        ]
        length, width = 0.15 + 0.3 * thick, 1.45 * thick
        foot = rounded_box(length, width, 0.035, 0.015 if build.limb in (_rods, _shells) else 0.003)
        tilt = pose.hips[k] - pose.knees[k] if pose.knees[k] < 0.7 and pose.hips[k] > 0.5 else 0.0
        parts.append(
            foot.shifted((0.025, 0.0, -0.045)).turned(rotation(pitch=-0.6 * tilt)).shifted(ankle).painted(build.shell)
        )
    return parts


def _upper(build: Build, pose: Pose) -> list[Solid]:
    """Torso and arms."""
    upright, _ = _trunk(pose)
    thick, wide = build.thickness, 2.0 * build.shoulders - build.thickness
    soft = 0.06 if build.limb in (_rods, _shells) else 0.01
    torso = rounded_box(0.15, wide, 0.25, soft).shifted((0.0, 0.0, 0.20)).painted(build.torso)
    waist = cylinder(0.05, 0.12, 12).shifted((0.0, 0.0, 0.05)).painted(build.inner)
    number = box(0.008, 0.07, 0.07).shifted((-0.075, 0.0, 0.22)).painted(build.marker)
    chest = box(0.008, 0.3 * wide, 0.05).shifted((0.075, 0.0, 0.24)).painted(build.inner)
    parts = [each.turned(upright) for each in (torso, waist, number, chest)]
    for k, side in enumerate((-1.0, 1.0)):
        shoulder = upright @ np.array([0.0, side * build.shoulders, 0.28])
        elbow = shoulder + 0.17 * _downward(pose.shoulders[k], side * pose.arms[k])
        hand = elbow + 0.15 * _downward(pose.shoulders[k] + pose.elbows[k], 0.5 * side * pose.arms[k])
        parts += [
            sphere(0.55 * thick, 12).shifted(shoulder).painted(build.inner),
            build.limb(shoulder, elbow, 0.75 * thick).painted(build.shell),
            axle(elbow, 0.4 * thick, 0.7 * thick, 10).painted(build.inner),
            build.limb(elbow, hand, 0.65 * thick).painted(build.marker if k else build.shell),
            sphere(0.42 * thick, 10).shifted(hand).painted(build.inner),
        ]
    return parts


def _head(random: np.random.Generator, build: Build, pose: Pose) -> list[Solid]:
    """A neck and a head: a sphere with eyes, a box with a visor, or a camera."""
    _, top = _trunk(pose)
    kind = random.integers(3)
    eye = glass(random)
    if kind == 0:
        skull = sphere(0.075, 16).stretched(0.95, 0.9, 1.05).painted(build.shell)
        face = [sphere(0.02, 8).shifted((0.06, y, 0.015)).painted(eye) for y in (-0.03, 0.03)]
    elif kind == 1:
        skull = rounded_box(0.11, 0.13, 0.12, 0.02).painted(build.shell)
        face = [box(0.01, 0.11, 0.04).shifted((0.055, 0.0, 0.02)).painted(eye)]
    else:
        skull = box(0.06, 0.12, 0.06).painted(build.inner)
        face = [rod((0.03, 0.0, 0.0), (0.06, 0.0, 0.0), 0.022).painted(eye)]
    turned = rotation(pitch=pose.head[1], yaw=pose.head[0])
    neck = capsule(top, np.add(top, (0.0, 0.0, 0.06)), 0.028).painted(build.inner)
    return [neck, *(each.turned(turned).shifted(np.add(top, (0.0, 0.0, 0.10))) for each in (skull, *face))]


def _trunk(pose: Pose) -> tuple[Floats, Floats]:
    """Rotation (3, 3) of the trunk and position (3,) of the neck."""
    upright = rotation(pitch=pose.lean)
    return upright, upright @ np.array([0.0, 0.0, 0.33])


def _downward(forward: float, outward: float) -> Floats:
    """Direction (3,) of a limb, downward at zero angles [rad]; outward is +y."""
    return np.array([np.sin(forward) * np.cos(outward), np.sin(outward), -np.cos(forward) * np.cos(outward)])


def _rods(start: Point, end: Point, thickness: float) -> Solid:
    return capsule(start, end, thickness / 2.0, 0.42 * thickness)


def _beams(start: Point, end: Point, thickness: float) -> Solid:
    return beam(start, end, 0.85 * thickness, thickness)


def _shells(start: Point, end: Point, thickness: float) -> Solid:
    return between(rounded_box(thickness, thickness, distance(start, end), 0.35 * thickness), start, end)


def _plates(start: Point, end: Point, thickness: float) -> Solid:
    """Two parallel brackets, like those of servos."""
    plate = box(0.8 * thickness, 0.12 * thickness, distance(start, end))
    pair = [plate.shifted((0.0, side * 0.45 * thickness, 0.0)) for side in (-1.0, 1.0)]
    return between(merged([*pair, box(0.5 * thickness, 0.78 * thickness, 0.6 * distance(start, end))]), start, end)
