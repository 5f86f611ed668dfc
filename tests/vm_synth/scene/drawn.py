"""Scenes for the tests of this room, and what they contain."""

import math
from dataclasses import replace

import numpy as np

from vm_synth.scene.configuration import SceneConfiguration, TargetRanges, ThingRanges
from vm_synth.scene.draw_scene import draw_scene
from vm_synth.scene.environment import Environment
from vm_synth.scene.field import FieldRanges

DEFAULT = SceneConfiguration()

NOTHING = ThingRanges(robots=(0, 0), clutter=(0, 0), round_things=(0, 0), furniture=(0, 0), people=(0, 0), carrier=0.0)

NO_OTHER = {"off_plane": 0.0, "wrong_size": 0.0}

FLOOR = math.radians(15.0)


def under(floor=None):
    """An evenly gray environment."""
    return Environment("gray", np.full((64, 128, 3), 0.5, dtype=np.float32), floor)


def bare(**ball):
    """A configuration of scenes with nothing but a ball."""
    return replace(
        DEFAULT,
        things=NOTHING,
        field=FieldRanges(goals=0.0),
        ball=TargetRanges(**({"missing": 0.0, "hidden": 0.0, "cut": 0.0} | NO_OTHER | ball)),
    )


def scenes(count, configuration=DEFAULT, floor=None, first=0):
    environment = under(floor)
    return [draw_scene(np.random.default_rng(first + seed), configuration, environment) for seed in range(count)]


def bodies(scene):
    """Name, vertices (n, 3) and triangles' corners (m, 3, 3) of each body of a scene."""
    first = 0
    corners = scene.mesh.vertices[scene.mesh.triangles].astype(np.float64)
    for name, count in zip(scene.names, scene.counts, strict=True):
        own = (scene.mesh.triangles[:, 0] >= first) & (scene.mesh.triangles[:, 0] < first + count)
        yield name, scene.mesh.vertices[first : first + count], corners[own]
        first += count
    assert first == len(scene.mesh.vertices)


def balls(scene):
    return [each for each in (scene.ball, scene.other) if each is not None]
