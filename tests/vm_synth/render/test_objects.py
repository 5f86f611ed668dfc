"""Pictures of objects on tables: masks agree with outlines, and truths with masks."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import vm_synth
from vm_embedded.config.sections import read_sections
from vm_embedded.geometry.shapes import Cylinder
from vm_synth.bodies.solids import join_bodies
from vm_synth.bodies.targets import TARGETS, draw_target
from vm_synth.dataset.picture_writer import scene_description
from vm_synth.render.picture import render
from vm_synth.scene.configuration import CLASSES, SceneConfiguration
from vm_synth.scene.draw_scene import draw_scene
from vm_synth.scene.rooms import furnish_room
from vm_synth.scene.scene import PlacedObject
from vm_workstation.outlines import polygon_area, shape_outline

OBJECT = CLASSES.index("ball")
CUPS = read_sections(SceneConfiguration, Path(vm_synth.__file__).with_name("cups.toml"))
ROOM = furnish_room(0)
BARE = replace(
    CUPS,
    things=replace(CUPS.things, clutter=(0, 0), round_things=(0, 0)),
    object=replace(CUPS.object, count=(1, 1), wrong_size=0.0, cut=0.0, distance=(0.4, 0.9)),
)


def scene_with(solid, seed):
    """A scene with a single solid on a table."""
    random = np.random.default_rng(seed)
    scene = draw_scene(random, BARE, ROOM)
    (placed,) = scene.objects
    body = draw_target(random, TARGETS[solid](random), placed.radius, placed.height, (), "cup")
    body = body.moved(0.3, (*placed.center[:2], 0.0))
    return replace(scene, counts=(len(body.vertices),), mesh=join_bodies([body]))


@pytest.mark.parametrize("seed", range(3))
def test_the_mask_of_a_cylinder_is_its_outline(seed, tracer):
    scene = scene_with("cylinder", seed)
    picture = render(scene, ROOM, tracer, CUPS.ground)
    (placed,) = scene.objects
    outline = shape_outline(
        scene.lens, scene.orientation, Cylinder(placed.radius, placed.height), placed.center, scene.size
    )
    shown = np.zeros(picture.classes.shape, dtype=np.uint8)
    cv2.fillPoly(shown, [np.rint(outline * 16).astype(np.int32)], 1, shift=4)
    mask = picture.classes == OBJECT
    assert mask.sum() > 100
    assert np.count_nonzero(mask != (shown > 0)) < 0.06 * mask.sum() + 8
    assert picture.areas[0] == pytest.approx(picture.coverage.sum(), rel=1e-4)
    assert picture.areas[0] == pytest.approx(polygon_area(outline), rel=0.02)


@pytest.mark.parametrize("solid", TARGETS)
def test_a_whole_object_is_wholly_visible(solid, tracer):
    scene = scene_with(solid, 4)
    picture = render(scene, ROOM, tracer, CUPS.ground)
    (described,) = scene_description(0, ROOM.name, scene, picture)["objects"]
    assert 0.9 < described["visible"] <= 1.0
    x, y = described["pixel"]
    assert picture.classes[round(y), round(x)] == OBJECT


def test_a_hidden_object_is_not_visible_and_both_are_told_apart(tracer):
    scene = scene_with("cylinder", 1)
    (placed,) = scene.objects
    ahead = placed.center[:2] / np.linalg.norm(placed.center[:2])
    behind = PlacedObject(placed.center + 0.1 * np.array([*ahead, 0.0]), placed.radius, placed.height)
    random = np.random.default_rng(0)
    bodies = [
        draw_target(random, TARGETS["cylinder"](random), each.radius, each.height, (), "cup").moved(
            0.0, (*each.center[:2], 0.0)
        )
        for each in (placed, behind)
    ]
    counts = tuple(len(each.vertices) for each in bodies)
    both = replace(scene, objects=(placed, behind), names=("cup", "cup"), counts=counts, mesh=join_bodies(bodies))
    picture = render(both, ROOM, tracer, CUPS.ground)
    first, second = scene_description(0, ROOM.name, both, picture)["objects"]
    assert first["visible"] > 0.95
    assert 0.05 < second["visible"] < 0.9
    assert sum(picture.areas) == pytest.approx(picture.coverage.sum(), rel=1e-4)


def test_shadows_fall_on_the_table_only(tracer):
    scene = scene_with("cylinder", 2)
    empty = replace(scene, objects=(), counts=(), names=(), mesh=join_bodies([]))
    plain = render(empty, ROOM, tracer, CUPS.ground).radiance
    picture = render(scene, ROOM, tracer, CUPS.ground)
    changed = np.abs(picture.radiance - plain).max(axis=-1) > 1e-3 * plain.mean()
    rays = scene.lens.unproject(
        np.stack(np.meshgrid(*map(np.arange, scene.size)), axis=-1).reshape(-1, 2).astype(float), scene.size
    )
    rays = rays @ scene.orientation.rotation.T
    points = rays[:, :2] * (scene.orientation.height / np.maximum(-rays[:, 2:], 1e-9))
    off = (scene.surface.depth_inside(scene.surface.local(points)) < -0.02) | (rays[:, 2] >= 0.0)
    far = cv2.dilate((picture.coverage > 0).astype(np.uint8), np.ones((5, 5), np.uint8)) == 0
    assert not (changed & off.reshape(changed.shape) & far).any()
    assert (changed & far).any()
