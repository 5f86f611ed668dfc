"""All kinds of bodies, and the section [bodies] of the configuration with their sizes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vm_embedded.config.entries import check_entries, share
from vm_workstation.ranges import log_uniform, range_of, some_of, uniform

from .boxy_robot import boxy_robot
from .carrier import CARRIERS, camera_carrier, carriers_for
from .clutter import CLUTTER, FURNITURE
from .distractors import DISTRACTORS
from .people import legs, person, shoes
from .robots import fallen, humanoid, nao, wheeled_robot
from .solids import Body, DrawBody

ROBOTS: dict[str, DrawBody] = {
    "humanoid": humanoid,
    "nao": nao,
    "fallen": fallen,
    "wheeled": wheeled_robot,
    "boxy": boxy_robot,
}
"""Robots by name; their size is the height."""

PEOPLE: dict[str, DrawBody] = {"legs": legs, "person": person}
"""People by name; their size is the height of the whole person."""

KINDS: dict[str, DrawBody] = {**CLUTTER, "shoes": shoes, **FURNITURE, **DISTRACTORS, **ROBOTS, **PEOPLE}
"""All kinds that are drawn with one size: the longest side, a radius or a height [m]."""


@dataclass(frozen=True)
class BodyRanges:
    """Section [bodies]: kinds and sizes of the objects on and around the field."""

    clutter_size: tuple[float, float] = range_of(0.05, 0.5, "longest side of small objects", "m", (0.01, 5.0))
    clutter_kinds: tuple[str, ...] = some_of((*CLUTTER, "shoes"), "kinds of small objects")
    shoe_length: tuple[float, float] = range_of(0.2, 0.33, "length of a shoe", "m", (0.1, 0.5))
    furniture_size: tuple[float, float] = range_of(0.6, 2.5, "longest side of large objects", "m", (0.1, 20.0))
    furniture_kinds: tuple[str, ...] = some_of(tuple(FURNITURE), "kinds of large objects")
    robot_height: tuple[float, float] = range_of(0.4, 1.6, "height of robots", "m", (0.1, 3.0))
    robot_kinds: tuple[str, ...] = some_of(
        tuple(ROBOTS),
        "kinds of robots; a nao is always 0.58 m tall, and boxy ones are large boxes on wheels",
        ("humanoid", "nao", "fallen", "wheeled"),
    )
    person_height: tuple[float, float] = range_of(1.5, 1.95, "height of people", "m", (0.5, 2.5))
    legs_share: float = share(0.7, "share of people with only their legs in the scene")
    distractor_radius: tuple[float, float] = range_of(
        0.02, 0.25, "radius of round objects that are not the ball", "m", (0.005, 2.0)
    )
    distractor_kinds: tuple[str, ...] = some_of(tuple(DISTRACTORS), "kinds of round objects that are not the ball")
    distractor_gap: float = share(0.3, "radius of white spheres differs from the ball's by at least this share")
    carrier_kinds: tuple[str, ...] = some_of(tuple(CARRIERS), "kinds of carriers of the camera")

    def __post_init__(self) -> None:
        check_entries(self)


def draw_clutter(random: np.random.Generator, ranges: BodyRanges) -> list[Body]:
    """Draw a small object."""
    kind = _one(random, ranges.clutter_kinds)
    if kind == "shoes":
        return draw_shoes(random, ranges)
    return CLUTTER[kind](random, log_uniform(random, ranges.clutter_size))


def draw_shoes(random: np.random.Generator, ranges: BodyRanges) -> list[Body]:
    """Draw a shoe or a pair."""
    return shoes(random, uniform(random, ranges.shoe_length))


def draw_furniture(random: np.random.Generator, ranges: BodyRanges) -> list[Body]:
    """Draw a large object."""
    return FURNITURE[_one(random, ranges.furniture_kinds)](random, log_uniform(random, ranges.furniture_size))


def draw_robot(random: np.random.Generator, ranges: BodyRanges) -> list[Body]:
    """Draw a robot."""
    return ROBOTS[_one(random, ranges.robot_kinds)](random, log_uniform(random, ranges.robot_height))


def draw_person(random: np.random.Generator, ranges: BodyRanges) -> list[Body]:
    """Draw a person or only the legs."""
    kind = "legs" if random.uniform() < ranges.legs_share else "person"
    return PEOPLE[kind](random, uniform(random, ranges.person_height))


def draw_distractor(random: np.random.Generator, ranges: BodyRanges, ball_radius: float) -> list[Body]:
    """Draw a round object that is not the ball of this radius [m]. White spheres differ clearly in radius."""
    kind = _one(random, ranges.distractor_kinds)
    radius = log_uniform(random, ranges.distractor_radius)
    if kind == "white_sphere" and abs(radius / ball_radius - 1.0) < ranges.distractor_gap:
        radius = ball_radius * (1.0 + ranges.distractor_gap * random.choice([-1.0, 1.0]))
    return DISTRACTORS[kind](random, radius)


def draw_carrier(random: np.random.Generator, ranges: BodyRanges, height: float) -> Body | None:
    """Draw the carrier of a camera at this height [m], in the carrier's frame; None if no kind fits the height."""
    kinds = [kind for kind in carriers_for(height) if kind in ranges.carrier_kinds]
    return camera_carrier(random, height, _one(random, kinds)) if kinds else None


def _one(random: np.random.Generator, names: tuple[str, ...] | list[str]) -> str:
    return names[random.integers(len(names))]
