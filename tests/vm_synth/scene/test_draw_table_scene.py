"""Objects stand on their table, apart from each other, where the camera sees them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import vm_synth
from vm_embedded.config.sections import read_sections
from vm_embedded.errors import InputError
from vm_synth.bodies.solids import LABELS
from vm_synth.scene.configuration import SceneConfiguration
from vm_synth.scene.own_object import ObjectRanges

from .drawn import bodies, scenes

EXAMPLES = {name: Path(vm_synth.__file__).with_name(f"{name}.toml") for name in ("cups", "cones")}


@pytest.fixture(scope="module", params=EXAMPLES)
def ranges(request):
    return read_sections(SceneConfiguration, EXAMPLES[request.param])


@pytest.fixture(scope="module")
def many(ranges):
    return scenes(40, ranges)


def test_the_same_chance_draws_the_same_scene(ranges):
    for first, second in zip(scenes(3, ranges), scenes(3, ranges), strict=True):
        assert (first.names, first.counts, first.seed) == (second.names, second.counts, second.seed)
        np.testing.assert_array_equal(first.mesh.vertices, second.mesh.vertices)
        np.testing.assert_array_equal(first.surface.texture, second.surface.texture)


def test_objects_stand_apart_on_the_surface_below_the_camera(ranges, many):
    for scene in many:
        spots = [each.center[:2] for each in scene.objects]
        for each in scene.objects:
            assert scene.surface.on_carpet(each.center[:2], 0.0)
            assert each.center[2] == each.height / 2.0
            assert ranges.object.distance[0] <= np.hypot(*each.center[:2]) <= ranges.object.distance[1]
            assert each.height < scene.orientation.height
            assert (each.radius, each.height) == (scene.ball_radius, scene.object_height)
        for number, spot in enumerate(spots):
            for other in spots[:number]:
                assert np.linalg.norm(spot - other) > 2.0 * scene.ball_radius


def test_the_first_bodies_are_the_objects(ranges, many):
    assert sum(len(each.objects) for each in many) > 20
    for scene in many:
        found = list(bodies(scene))
        for (name, vertices, _), placed in zip(found, scene.objects, strict=False):
            assert name == ranges.object.name
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            assert (low + high)[:2] / 2.0 == pytest.approx(placed.center[:2], abs=0.05 * placed.radius)
            assert high[2] == pytest.approx(placed.height, rel=1e-4)
        labels = [LABELS[each] for each in scene.mesh.labels]
        assert labels.count("ball") == sum(len(corners) for _, _, corners in found[: len(scene.objects)])


def test_the_camera_sees_the_middle_of_every_object(many):
    for scene in many:
        for each in scene.objects:
            ray = (each.center - scene.camera) @ scene.orientation.rotation
            ray /= np.linalg.norm(ray)
            x, y = scene.lens.project(ray[None], scene.size)[0]
            assert -1.0 <= x <= scene.size[0]
            assert -1.0 <= y <= scene.size[1]


@pytest.mark.long
def test_other_sizes_are_no_objects(ranges):
    always = replace(ranges, object=replace(ranges.object, wrong_size=1.0))
    found = [scene for scene in scenes(20, always) if f"other {ranges.object.name}" in scene.names]
    assert len(found) > 10
    for scene in found:
        number = scene.names.index(f"other {ranges.object.name}")
        assert number >= len(scene.objects)
        vertices = list(bodies(scene))[number][1]
        assert not 0.7 < np.ptp(vertices[:, 2]) / scene.object_height < 1.5


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"solid": "file"}, "must name an .obj or .ply file"),
        ({"solid": "cup", "file": "cup.obj"}, "empty otherwise"),
        ({"solid": "mug"}, "unknown solid"),
        ({"solid": "cup", "name": "my cup"}, "one word"),
        ({"solid": "cup", "radius": (0.1, 0.05)}, "above"),
    ],
)
def test_objects_that_make_no_sense_are_refused(entries, said):
    with pytest.raises(InputError, match=said):
        ObjectRanges(**entries)
