"""True objects of pictures: those of scenes against geometry, those of masks against those of scenes."""

import json
import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_embedded.geometry.shapes import Cylinder
from vm_embedded.network.manifest import ObjectClass
from vm_embedded.network.model_file import read_model
from vm_train.data.pictures import find_pictures, read_picture
from vm_train.evaluation.mask_colors import classes_with_colors, default_colors
from vm_train.truth.objects import SceneObject, SceneTruth, read_scene, true_objects
from vm_workstation.outlines import sphere_outline

from ...drawn_scenes import MODEL
from ..drawn import RADIUS, draw_set

MANIFEST = read_model(MODEL).manifest
USUAL = default_colors(Path("model.onnx"), None)
CLASSES = classes_with_colors(MANIFEST, USUAL, [])


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Drawn pictures with their scenes."""
    files = find_pictures(draw_set(tmp_path_factory.mktemp("drawn"), 12, seed=3))
    return [
        (read_picture(each, CLASSES), read_scene(each.image.with_name(f"scene{each.number}.json"))) for each in files
    ]


def whole_balls(pictures):
    """Pictures whose mask shows a ball that no border cuts: picture, scene, and mask (h, w)."""
    for picture, scene in pictures:
        mask = picture.labels == 0
        border = mask[[0, -1]].any() or mask[:, [0, -1]].any()
        if mask.any() and not border:
            yield picture, scene, mask


def test_a_scene_s_ball_covers_what_its_mask_shows(pictures):
    seen = list(whole_balls(pictures))
    assert len(seen) >= 4
    for picture, scene, mask in seen:
        (ball,) = true_objects(picture, scene, MANIFEST)["ball"]
        assert np.count_nonzero((ball.mask >= 0.5) != mask) <= 0.05 * mask.sum() + 3
        assert ball.radius == pytest.approx(math.sqrt(mask.sum() / math.pi), rel=0.05)
        assert ball.position.tolist() == scene.objects[0].center.tolist()
        assert ball.visible == 1.0
        toward = scene.objects[0].center - (0.0, 0.0, picture.lens.orientation.height)
        assert ball.offsets(toward[None] / np.linalg.norm(toward)) == pytest.approx(0.0, abs=1e-6)
        assert ball.angular_radius == pytest.approx(math.asin(RADIUS / np.linalg.norm(toward)))


def test_the_outline_of_a_ball_is_one_radius_from_its_center(pictures):
    for picture, scene, mask in whole_balls(pictures):
        (ball,) = true_objects(picture, scene, MANIFEST)["ball"]
        size, orientation = mask.shape[::-1], picture.lens.orientation
        outline = sphere_outline(picture.lens.lens.for_image(size), orientation, scene.objects[0].center, RADIUS, size)
        rays = picture.lens.lens.for_image(size).unproject(outline, size) @ orientation.rotation.T
        assert ball.offsets(rays) == pytest.approx(1.0, abs=1e-3)


def test_a_mask_alone_gives_nearly_the_same_ball(pictures):
    manifest = replace(MANIFEST, radius=RADIUS, object_radius=RADIUS)
    for picture, scene, mask in whole_balls(pictures):
        (ball,) = true_objects(picture, None, manifest)["ball"]
        assert (ball.mask == mask).all()
        assert ball.position == pytest.approx(scene.objects[0].center, rel=0.06, abs=0.02)
        (true,) = true_objects(picture, scene, manifest)["ball"]
        assert true.offsets(ball.bearing[None])[0] < 0.15
        assert ball.angular_radius == pytest.approx(true.angular_radius, rel=0.06)


def test_every_piece_of_a_mask_is_an_object(pictures):
    picture, _ = pictures[0]
    labels = np.full_like(picture.labels, 2)
    labels[100:110, 20:30] = 0
    labels[60, 90] = 0
    found = true_objects(replace(picture, labels=labels), None, MANIFEST)["ball"]
    assert sorted(int(each.mask.sum()) for each in found) == [1, 100]


def test_what_is_above_the_horizon_has_no_place(pictures):
    picture, _ = pictures[0]
    labels = np.full_like(picture.labels, 2)
    labels[0:3, 70:80] = 0
    (found,) = true_objects(replace(picture, labels=labels), None, MANIFEST)["ball"]
    assert np.isnan(found.position).all()
    assert np.isfinite(found.bearing).all()
    assert np.isnan(found.offsets(found.bearing[None])).all()


def test_a_radius_that_no_number_can_hold_is_a_fault_of_the_file(tmp_path):
    path = tmp_path / "scene0.json"
    path.write_text(json.dumps({"ball_radius": 10**400, "ball": None}))
    with pytest.raises(InputError, match=r"scene0\.json: is not a scene file of vm-synth"):
        read_scene(path)


def test_a_scene_without_a_ball_and_a_hidden_one(pictures):
    picture, _ = pictures[0]
    assert true_objects(picture, SceneTruth(RADIUS, ()), MANIFEST)["ball"] == []
    hidden = SceneObject(np.array([1.0, 0.1, RADIUS]), RADIUS, 0.0)
    (found,) = true_objects(picture, SceneTruth(RADIUS, (hidden,)), MANIFEST)["ball"]
    assert found.visible == 0.0
    assert found.mask.sum() > 10.0


def test_a_file_that_is_not_there_is_no_scene(tmp_path):
    assert read_scene(tmp_path / "scene1.json") is None


GOOD = {"ball_radius": 0.07, "ball": {"center": [1.0, 0.0, 0.07], "radius": 0.07, "visible": 1.0}}


@pytest.mark.parametrize(
    "change",
    [
        {"ball_radius": -1.0},
        {"ball_radius": None},
        {"ball": 3},
        {"ball": {"center": [1.0, 0.0], "radius": 0.07, "visible": 1.0}},
        {"ball": {"center": [1.0, math.nan, 0.0], "radius": 0.07, "visible": 1.0}},
        {"ball": {"center": [1.0, 0.0, 0.1], "radius": 0.0, "visible": 1.0}},
        {"ball": {"center": [1.0, 0.0, 0.1], "radius": 0.1, "visible": 2.0}},
        {"ball": {"center": [1.0, 0.0, 0.1], "radius": 0.1}},
    ],
)
def test_scenes_that_make_no_sense_are_named(tmp_path, change):
    path = tmp_path / "scene7.json"
    path.write_text(json.dumps(GOOD))
    assert read_scene(path).objects[0].radius == 0.07
    path.write_text(json.dumps(GOOD | change))
    with pytest.raises(InputError, match=r"^scene7\.json"):
        read_scene(path)


CUP = {"center": [0.9, 0.1, 0.05], "radius": 0.04, "height": 0.1, "visible": 0.8}
CUPS = GOOD | {"ball": None, "object": {"name": "cup", "radius": 0.04}, "objects": [CUP, CUP | {"visible": 0.0}]}


@pytest.mark.parametrize(
    "change",
    [
        {"object": {"radius": 0.04}},
        {"object": {"name": "cup", "radius": 0.0}},
        {"objects": None},
        {"objects": [CUP | {"height": -0.1}]},
        {"objects": [CUP | {"center": [1.0]}]},
        {"objects": [{"center": CUP["center"], "radius": 0.04, "visible": 1.0}]},
    ],
)
def test_scenes_have_several_objects_that_are_not_balls(tmp_path, change):
    path = tmp_path / "scene7.json"
    path.write_text(json.dumps(CUPS))
    found = read_scene(path)
    assert (found.class_name, found.radius) == ("cup", 0.04)
    assert [each.visible for each in found.objects] == [0.8, 0.0]
    assert found.objects[0].shape == Cylinder(0.04, 0.1)
    path.write_text(json.dumps(CUPS | change))
    with pytest.raises(InputError, match=r"^scene7\.json"):
        read_scene(path)


def test_a_cylinder_covers_the_pixels_whose_rays_hit_it(pictures):
    picture, _ = pictures[0]
    height, width = picture.labels.shape
    orientation, lens = picture.lens.orientation, picture.lens.lens.for_image((width, height))
    middle = lens.unproject(np.array([[width / 2.0, 0.7 * height]]), (width, height)) @ orientation.rotation.T
    shape = Cylinder(0.1, 0.5 * orientation.height)
    center = shape.center_along(middle, orientation.height)[0]
    cup = SceneObject(center + np.array([0.0, 0.0, orientation.height]), shape.radius, 1.0, shape.object_height)
    manifest = replace(MANIFEST, classes=(ObjectClass("cup", "object"), ObjectClass("other", "background")))
    (found,) = true_objects(picture, SceneTruth(0.1, (cup,), "cup"), manifest)["cup"]
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    rays = lens.unproject(np.stack([x, y], axis=-1).reshape(-1, 2).astype(float), (width, height))
    hit = shape.covers(rays @ orientation.rotation.T, center[None], orientation.height).reshape(height, width)
    assert hit.sum() > 50
    assert np.count_nonzero((found.mask >= 0.5) != hit) <= 0.05 * hit.sum() + 3
    assert found.angular_radius == pytest.approx(math.asin(0.1 / np.linalg.norm(center)))


@pytest.mark.parametrize("text", ["", "[1]", "{", "[" * 100000])
def test_damaged_scenes_are_named(tmp_path, text):
    path = tmp_path / "scene7.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"^scene7\.json"):
        read_scene(path)


def test_a_ball_that_the_border_cuts_covers_what_is_in_the_picture(pictures):
    picture, _ = pictures[0]
    height, width = picture.labels.shape
    orientation = picture.lens.orientation
    ray = picture.lens.lens.unproject(np.array([[0.0, height - 20.0]]), (width, height))[0] @ orientation.rotation.T
    center = ray * (orientation.height - RADIUS) / -ray[2] + (0.0, 0.0, orientation.height)
    (cut,) = true_objects(picture, SceneTruth(RADIUS, (SceneObject(center, RADIUS, 0.5),)), MANIFEST)["ball"]
    assert cut.mask.shape == (height, width)
    assert 0.3 < cut.mask.sum() / (math.pi * cut.radius**2) < 0.7
    assert cv2.countNonZero(cut.mask[:, width // 2 :]) == 0
