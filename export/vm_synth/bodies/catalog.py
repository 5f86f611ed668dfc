"""The bodies of a scene by name, and the section `[bodies]` of the configuration: which to draw and how large."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vm_embedded.config.entries import check_entries, share
from vm_workstation.ranges import log_uniform, range_of, some_of, uniform

from .carrier import CARRIERS, carriers, own_body
from .clutter import CLUTTER, FURNITURE, pedestal
from .distractors import DISTRACTORS, distractor_ball
from .goals import goal
from .people import legs, person, shoes
from .robots import fallen, humanoid, nao, wheeled_robot
from .solids import LABELS, Body, Joined, joined

__all__ = [
    "CARRIERS",
    "CLUTTER",
    "DISTRACTORS",
    "FURNITURE",
    "KINDS",
    "LABELS",
    "PEOPLE",
    "ROBOTS",
    "Body",
    "BodyRanges",
    "Joined",
    "distractor_ball",
    "draw_carrier",
    "draw_clutter",
    "draw_distractor",
    "draw_furniture",
    "draw_person",
    "draw_robot",
    "goal",
    "joined",
    "own_body",
    "pedestal",
]

Draw = Callable[[np.random.Generator, float], list[Body]]
"""A function of (random, size [m])."""

ROBOTS: dict[str, Draw] = {"humanoid": humanoid, "nao": nao, "fallen": fallen, "wheeled": wheeled_robot}
"""Robots by name: functions of (random, height [m])."""

PEOPLE: dict[str, Draw] = {"legs": legs, "person": person}
"""People by name: functions of (random, height of the whole person [m])."""

KINDS: dict[str, Draw] = {**CLUTTER, "shoes": shoes, **FURNITURE, **DISTRACTORS, **ROBOTS, **PEOPLE}
"""All that is drawn with one size: the longest side, a radius or a height [m], as its own table says."""


@dataclass(frozen=True)
class BodyRanges:
    """Section `[bodies]`: sizes and kinds of what stands on and around the field."""

    clutter_size: tuple[float, float] = range_of(0.05, 0.5, "longest side of small things", "m", (0.01, 5.0))
    clutter_kinds: tuple[str, ...] = some_of((*CLUTTER, "shoes"), "small things to draw")
    shoe_length: tuple[float, float] = range_of(0.2, 0.33, "length of a shoe", "m", (0.1, 0.5))
    furniture_size: tuple[float, float] = range_of(0.6, 2.5, "longest side of large things", "m", (0.1, 20.0))
    furniture_kinds: tuple[str, ...] = some_of(tuple(FURNITURE), "large things to draw")
    robot_height: tuple[float, float] = range_of(0.4, 1.6, "height of robots", "m", (0.1, 3.0))
    robot_kinds: tuple[str, ...] = some_of(tuple(ROBOTS), "robots to draw; a nao is always 0.58 m tall")
    person_height: tuple[float, float] = range_of(1.5, 1.95, "height of people", "m", (0.5, 2.5))
    legs_share: float = share(0.7, "share of people of whom only the legs are drawn")
    distractor_radius: tuple[float, float] = range_of(
        0.02, 0.25, "radius of round things that are not the ball", "m", (0.005, 2.0)
    )
    distractor_kinds: tuple[str, ...] = some_of(tuple(DISTRACTORS), "round things that are not the ball")
    distractor_gap: float = share(0.3, "how much a white sphere's radius differs from the ball's, as a part of it")
    carrier_kinds: tuple[str, ...] = some_of(tuple(CARRIERS), "what may hold the camera and be seen by it")

    def __post_init__(self) -> None:
        check_entries(self)


def draw_clutter(random: np.random.Generator, ranges: BodyRanges) -> list[Body]:
    """A small thing."""
    kind = _one(random, ranges.clutter_kinds)
    size = uniform(random, ranges.shoe_length) if kind == "shoes" else log_uniform(random, ranges.clutter_size)
    return KINDS[kind](random, size)


def draw_furniture(random: np.random.Generator, ranges: BodyRanges) -> list[Body]:
    """A large thing."""
    return FURNITURE[_one(random, ranges.furniture_kinds)](random, log_uniform(random, ranges.furniture_size))


def draw_robot(random: np.random.Generator, ranges: BodyRanges) -> list[Body]:
    """A robot."""
    return ROBOTS[_one(random, ranges.robot_kinds)](random, log_uniform(random, ranges.robot_height))


def draw_person(random: np.random.Generator, ranges: BodyRanges) -> list[Body]:
    """A person or the legs of one."""
    kind = "legs" if random.uniform() < ranges.legs_share else "person"
    return PEOPLE[kind](random, uniform(random, ranges.person_height))


def draw_distractor(random: np.random.Generator, ranges: BodyRanges, ball_radius: float) -> list[Body]:
    """A round thing that is not the ball of this radius [m]: a white sphere is drawn clearly smaller or larger."""
    kind = _one(random, ranges.distractor_kinds)
    radius = log_uniform(random, ranges.distractor_radius)
    if kind == "white_sphere" and abs(radius / ball_radius - 1.0) < ranges.distractor_gap:
        radius = ball_radius * (1.0 + ranges.distractor_gap * random.choice([-1.0, 1.0]))
    return DISTRACTORS[kind](random, radius)


def draw_carrier(random: np.random.Generator, ranges: BodyRanges, height: float) -> Body | None:
    """The carrier of a camera at this height [m], in the carrier's frame, or None where none can hold it."""
    kinds = [kind for kind in carriers(height) if kind in ranges.carrier_kinds]
    return own_body(random, height, _one(random, kinds)) if kinds else None


def _one(random: np.random.Generator, names: tuple[str, ...] | list[str]) -> str:
    return names[random.integers(len(names))]
