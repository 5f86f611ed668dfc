"""Which places show an object, and the targets of those that do."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.vm_embedded.detection.views import BALL, center_at, view_at
from tests.vm_train.drawn import CLASSES, RADIUS
from vm_embedded.config.sections import read_sections
from vm_embedded.detection.patches import Tangents
from vm_embedded.detection.settings import Settings
from vm_embedded.network.bundled import model_path
from vm_train.data.pictures import find_pictures, read_picture
from vm_train.evaluation.answers import load_subject
from vm_train.look.configuration import LookConfiguration
from vm_train.look.labels import NOTHING, OBJECT, UNLABELED, Truths, find_truths, label_places
from vm_train.truth.objects import SceneTruth, read_scene

VIEW = view_at()
pixels = st.tuples(st.floats(60.0, 580.0), st.floats(150.0, 500.0))
angles = st.floats(0.0, 6.28)


def ball(pixel, radius=BALL.radius, visible=1.0):
    """A ball on the plane, seen at this pixel."""
    center = center_at(VIEW, pixel)
    if not np.isfinite(center).all():
        assume(False)
    return Truths(center[None], np.array([radius]), np.array([visible]))


def place_beside(truths, off, angle):
    """The plane of a patch whose center is `off` expected radii from that of the truth, about."""
    ray = Tangents.at(VIEW, truths.centers).rays(np.array([off * np.cos(angle)]), np.array([off * np.sin(angle)]))
    if ray[0, 2] > -0.02:
        assume(False)
    return Tangents.at(VIEW, VIEW.shape.center_along(ray, VIEW.height))


def label(truths, off, angle=1.0):
    found = label_places(place_beside(truths, off, angle), truths)
    assert found.of[0] == (0 if found.labels[0] == OBJECT else -1)
    assert found.labels[0] == OBJECT or not found.targets.any()
    return found.labels[0]


@given(pixels, st.floats(0.0, 0.5), angles)
def test_a_place_near_a_ball_shows_it_and_the_targets_lead_to_its_center_and_size(pixel, off, angle):
    truths = ball(pixel)
    place = place_beside(truths, off, angle)
    found = label_places(place, truths)
    assert found.labels.tolist() == [OBJECT]
    right, down, size = found.targets.astype(float).T
    ray = place.rays(right, down)
    distance = np.linalg.norm(truths.centers, axis=1, keepdims=True)
    assert ray == pytest.approx(truths.centers / distance, abs=1e-6)
    radius = np.tan(np.arcsin(BALL.radius / distance[0]))
    assert np.exp(size) * place.radius == pytest.approx(radius, rel=1e-5)


@given(pixels, angles)
def test_places_show_a_ball_or_none_or_are_left_out_by_their_distance(pixel, angle):
    truths = ball(pixel)
    assert label(truths, 0.6, angle) == OBJECT
    assert label(truths, 1.1, angle) in (UNLABELED, NOTHING if angle > np.pi else UNLABELED)
    assert label(truths, 1.7, angle) == NOTHING


@given(pixels, st.sampled_from([(1.0, OBJECT), (1.25, OBJECT), (1.45, UNLABELED), (1.9, NOTHING)]), st.booleans())
def test_balls_of_another_size_are_not_the_object(pixel, case, is_small):
    factor, expected = case
    assert label(ball(pixel, BALL.radius * (1.0 / factor if is_small else factor)), 0.0) == expected


@given(pixels, st.floats(0.0, 0.24))
def test_near_a_hidden_ball_nothing_is_labeled(pixel, visible):
    assert label(ball(pixel, visible=visible), 0.3) == UNLABELED
    assert label(ball(pixel, visible=visible), 1.8) == NOTHING


def test_the_nearest_of_two_balls_counts():
    near, far = ball((320.0, 300.0)), ball((335.0, 300.0))
    names = ("centers", "radii", "visible")
    both = Truths(*(np.concatenate([getattr(each, name) for each in (far, near)]) for name in names))
    found = label_places(place_beside(near, 0.05, 0.0), both)
    assert (found.labels[0], found.of[0]) == (OBJECT, 1)


def test_without_objects_every_place_shows_nothing():
    found = label_places(place_beside(ball((320.0, 300.0)), 0.0, 0.0), Truths.none())
    assert (found.labels.tolist(), found.of.tolist(), found.targets.tolist()) == ([NOTHING], [-1], [[0.0, 0.0, 0.0]])


def test_an_object_behind_the_camera_is_nowhere_near():
    truths = ball((320.0, 300.0))
    behind = Truths(-truths.centers, truths.radii, truths.visible)
    assert label_places(place_beside(truths, 0.0, 0.0), behind).labels.tolist() == [NOTHING]


def test_truth_from_a_mask_is_near_that_of_the_scene(drawn, tmp_path):
    """The mask's ball is smaller where the picture ends."""
    (tmp_path / "look.toml").write_text(CLASSES)
    table = read_sections(LookConfiguration, tmp_path / "look.toml").classes
    subject = load_subject(model_path("ball"), Settings())
    compared = 0
    for files in find_pictures(drawn):
        picture, scene = read_picture(files, table.mask_classes()), read_scene(drawn / f"scene{files.number}.json")
        observation = subject.observe(picture, RADIUS)
        manifest = replace(observation.manifest, classes=table.outputs, self_test=None)
        exact = find_truths(picture, scene, manifest, observation.view, "ball")
        seen = find_truths(picture, None, manifest, observation.view, "ball")
        if len(exact) and len(seen) == 1 and seen.visible[0] > 0.9:
            compared += 1
            assert seen.centers == pytest.approx(exact.centers, abs=0.05)
            assert seen.radii == pytest.approx(exact.radii)
        of_boxes = SceneTruth(RADIUS, (), in_mask=True)  # as vm-train import-boxes writes it
        imported = find_truths(picture, of_boxes, manifest, observation.view, "ball")
        assert np.array_equal(imported.centers, seen.centers)
        assert len(imported.radii) == len(imported.visible) == len(seen)
    assert compared > 3
