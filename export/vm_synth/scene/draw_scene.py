"""Draws a scene from the ranges of the configuration."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import RadialLens
from vm_workstation.ranges import drawn, uniform

from ..bodies.solids import Body, join_bodies
from ..bodies.targets import TARGETS, draw_target
from .camera import draw_lens, draw_orientation
from .configuration import SceneConfiguration
from .environment import Environment
from .field import Field, draw_field, with_line_at
from .own_object import NO_ASSETS, Assets
from .placement import ATTEMPTS, NEAREST, Placement, draw_ball_at, in_picture, intersects_ball
from .scene import PlacedObject, Scene
from .sensor import draw_sensor
from .surface import Surface, draw_surface

_BELOW = np.zeros(2)
"""The point of the plane below the camera [m]."""


def draw_scene(
    random: np.random.Generator, ranges: SceneConfiguration, environment: Environment, assets: Assets = NO_ASSETS
) -> Scene:
    """Draw a scene under an environment map. assets: the files of the configuration."""
    if not ranges.object.is_ball:
        return draw_table_scene(random, ranges, assets)
    lens = draw_lens(random, ranges.camera)
    photographed = environment.floor is not None and random.random() < ranges.ground.photographed
    floor = environment.floor if photographed else None
    radius = uniform(random, ranges.ball.radius)
    missing = random.random() < ranges.ball.missing
    orientation, spot = _draw_camera_and_spot(random, ranges, lens, radius, floor)
    field = None if photographed else _draw_field_around(random, ranges, _BELOW if spot is None else spot, radius)

    ball = None if missing or spot is None else draw_ball_at(random, ranges, np.array([*spot, radius]), radius)
    placement = Placement(random, ranges, lens, orientation, field, floor)
    if ball is not None:
        placement.keep_clear(ball.center[:2], radius)
        if random.random() < ranges.ball.hidden:
            placement.add_between(ball.center[:2], radius)
        if drawn(random, ranges.ball.touched):
            placement.add_touching(ball)
    other, label = placement.draw_other_ball(radius)
    if field is not None and random.random() < ranges.field.goals:
        placement.add_goals(field)
    placement.add_all(radius)
    bodies = [each for each in placement.bodies if not (intersects_ball(each, ball) or intersects_ball(each, other))]
    return Scene(
        lens=lens,
        size=ranges.camera.size,
        orientation=orientation,
        field=field,
        ball_radius=radius,
        ball=ball,
        other=other,
        other_label=label,
        names=tuple(each.name for each in bodies),
        counts=tuple(len(each.vertices) for each in bodies),
        mesh=join_bodies(bodies),
        ground_albedo=field.grass if field else environment.floor_albedo,
        sensor=draw_sensor(random, ranges.sensor),
        seed=int(random.integers(1 << 31)),
    )


def _draw_camera_and_spot(
    random: np.random.Generator, ranges: SceneConfiguration, lens: RadialLens, radius: float, floor: float | None
) -> tuple[Orientation, Floats | None]:
    """Draw a camera and a point (2,) [m] where it sees a ball; None in place of the point if many attempts fail.

    The ball's angular size, or its distance, has a uniform distribution. floor: angle below the horizon where a
    photographed floor begins [rad], or None.

    The paper's balls are uniform in pixel size, from 0 to 10 m (section "Dataset").
    """
    for _ in range(ATTEMPTS):
        orientation = draw_orientation(random, ranges.camera)
        low, high = ranges.ball.distance
        if floor is not None:
            high = min(high, max(orientation.height - radius, 0.0) / math.tan(floor))
        rise = max(orientation.height - radius, radius)  # a camera below the top of the ball sees it, too
        low = min(low, high)
        if ranges.ball.even and random.random() < ranges.ball.even:
            distance = random.uniform(low, high)
            angle = _angular_radius(radius, distance, rise)
        else:
            angle = random.uniform(_angular_radius(radius, high, rise), _angular_radius(radius, low, rise))
            distance = math.sqrt(max((radius / math.sin(angle)) ** 2 - rise**2, 0.0))
        heading = random.uniform(-np.pi, np.pi, 256)
        spots = distance * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        depth = np.full(len(spots), radius - orientation.height)
        rays = np.column_stack([spots, depth])
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        cut = 0.6 * angle if random.random() < ranges.ball.cut else -1.0 * angle
        good = np.flatnonzero(in_picture(lens, ranges.camera.size, rays @ orientation.rotation, cut))
        if len(good) and distance > NEAREST * (orientation.height < 4.0 * radius):
            return orientation, spots[good[0]]
    return orientation, None


def _angular_radius(radius: float, distance: float, rise: float) -> float:
    """Angular radius [rad] of a ball at a distance on the plane, whose center is lower than the camera by `rise`; all
    [m]."""
    return math.asin(radius / max(math.hypot(distance, rise), 1.01 * radius))


def _draw_field_around(random: np.random.Generator, ranges: SceneConfiguration, spot: Floats, radius: float) -> Field:
    """Draw a field below the camera, with the spot (2,) [m] of the ball on its carpet if possible."""
    at_line = drawn(random, ranges.ball.on_line)
    for _ in range(ATTEMPTS):
        field = draw_field(random, ranges.field)
        if at_line:
            field = with_line_at(random, field, spot, 0.5 * field.line_width + radius)
        if field.on_carpet(spot, 2.0 * radius) and (field.on_carpet(_BELOW) or not at_line):
            break
    return field


def draw_table_scene(random: np.random.Generator, ranges: SceneConfiguration, assets: Assets) -> Scene:
    """Draw a scene with the objects of section [object]."""
    lens = draw_lens(random, ranges.camera)
    radius, height = uniform(random, ranges.object.radius), uniform(random, ranges.object.height)
    orientation = draw_orientation(random, ranges.camera)
    while orientation.height <= 1.05 * height and orientation.height < ranges.camera.height[1]:
        orientation = draw_orientation(random, ranges.camera)
    count = int(random.integers(int(ranges.object.count[0]), int(ranges.object.count[1]) + 1))
    spots = _draw_spots(random, ranges, lens, orientation, radius, height, max(count, 1))
    while not len(spots):
        orientation = draw_orientation(random, ranges.camera)
        spots = _draw_spots(random, ranges, lens, orientation, radius, height, max(count, 1))
    surface = draw_surface(random, ranges.table, ranges.ground.kind == "table", assets.ground, spots[0])
    spots = [each for each in spots[:count] if surface.on_carpet(each, 0.9 * radius)]

    placement = Placement(random, ranges, lens, orientation, surface, None)
    for spot in spots:
        placement.keep_clear(spot, radius)
    targets = [_draw_body(random, ranges, assets, radius, height) for _ in spots]
    bodies = [each.moved(0.0, (*spot, 0.0)) for each, spot in zip(targets, spots, strict=True)]
    if random.random() < ranges.object.wrong_size:
        placement.add([_wrong_size(random, ranges, assets, radius, height)])
    placement.add_all(radius)
    bodies += placement.bodies
    return Scene(
        lens=lens,
        size=ranges.camera.size,
        orientation=orientation,
        field=None,
        ball_radius=radius,
        ball=None,
        other=None,
        other_label="environment",
        names=tuple(each.name for each in bodies),
        counts=tuple(len(each.vertices) for each in bodies),
        mesh=join_bodies(bodies),
        ground_albedo=_mean_color(surface),
        sensor=draw_sensor(random, ranges.sensor),
        seed=int(random.integers(1 << 31)),
        surface=surface,
        objects=tuple(PlacedObject(np.array([*spot, height / 2.0]), radius, height) for spot in spots),
        object_name=ranges.object.name,
        object_height=height,
    )


def _draw_body(
    random: np.random.Generator, ranges: SceneConfiguration, assets: Assets, radius: float, height: float
) -> Body:
    own = ranges.object
    solid = TARGETS[own.solid](random) if assets.solid is None else assets.solid
    return draw_target(random, solid, radius, height, assets.textures, own.name)


def _wrong_size(
    random: np.random.Generator, ranges: SceneConfiguration, assets: Assets, radius: float, height: float
) -> Body:
    """An object that is clearly smaller or larger, of class environment."""
    factor = uniform(random, ranges.object.larger if random.random() < 0.5 else ranges.object.smaller)
    made = _draw_body(random, ranges, assets, factor * radius, factor * height)
    return replace(made, label="environment", name=f"other {made.name}")


def _draw_spots(
    random: np.random.Generator,
    ranges: SceneConfiguration,
    lens: RadialLens,
    orientation: Orientation,
    radius: float,
    height: float,
    count: int,
) -> list[Floats]:
    """Up to `count` points (2,) [m] where the camera sees an object, apart from each other."""
    own, spots = ranges.object, list[Floats]()
    for _ in range(ATTEMPTS):
        if len(spots) == count:
            break
        distance = max(uniform(random, own.distance), NEAREST + radius)
        heading = random.uniform(-math.pi, math.pi, 64)
        places = distance * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        rays = np.column_stack([places, np.full(len(places), height / 2.0 - orientation.height)])
        length = np.linalg.norm(rays, axis=1, keepdims=True)
        reach = math.hypot(radius, height / 2.0) / float(length[0, 0])
        margin = (0.0 if random.random() < own.cut else -1.0) * reach
        good = places[in_picture(lens, ranges.camera.size, (rays / length) @ orientation.rotation, margin)]
        free = [each for each in good if all(np.linalg.norm(each - other) > own.apart * radius for other in spots)]
        spots += free[:1]
    return spots


def _mean_color(surface: Surface) -> tuple[float, float, float]:
    red, green, blue = surface.texture.mean(axis=(0, 1)).tolist()
    return red, green, blue
