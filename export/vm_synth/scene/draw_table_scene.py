"""Draws a scene with objects on a table or floor."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import RadialLens
from vm_workstation.ranges import uniform

from ..bodies.solids import Body, join_bodies
from ..bodies.targets import TARGETS, draw_target
from .camera import draw_lens, draw_orientation
from .configuration import SceneConfiguration
from .own_object import Assets
from .placement import ATTEMPTS, NEAREST, Placement, in_picture
from .scene import PlacedObject, Scene
from .sensor import draw_sensor
from .surface import Surface, draw_surface


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
