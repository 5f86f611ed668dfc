"""The places that patches are cut at."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.vm_embedded.detection import test_looking
from tests.vm_embedded.detection.views import BALL, center_at, observation_of, view_at
from vm_embedded.detection.patches import Tangents
from vm_train.look.configuration import PatchSettings
from vm_train.look.labels import Truths, label_places
from vm_train.look.places import PatchPlaces, jittered_places, random_places

VIEW = view_at()
NEAR, FAR = center_at(VIEW, (320.0, 330.0)), center_at(VIEW, (200.0, 230.0))


def truths(*centers, visible=1.0):
    count = len(centers)
    return Truths(np.array(centers).reshape(-1, 3), np.full(count, BALL.radius), np.full(count, visible))


def random(seed):
    return np.random.default_rng(seed)


@given(st.integers(0, 2**32), st.floats(0.0, 1.0))
def test_jittered_places_are_beside_objects_in_turn(seed, jitter):
    wanted = PatchSettings(jittered=6, jitter=jitter, size_jitter=0.2)
    found = jittered_places(VIEW, truths(NEAR, FAR), wanted, random(seed))
    assert len(found) == 6
    assert (np.abs(np.log(found.factors)) <= 0.2).all()
    rays = found.centers / np.linalg.norm(found.centers, axis=1, keepdims=True)
    off = BALL.offset(rays, np.stack([NEAR, FAR]), VIEW.height)
    assert (off[np.arange(6) % 2, np.arange(6)] <= jitter + 0.02).all()  # tangents there, chords here


def test_hidden_objects_and_pictures_without_any_have_no_jittered_places():
    assert len(jittered_places(VIEW, truths(), PatchSettings(), random(0))) == 0
    assert len(jittered_places(VIEW, truths(NEAR, visible=0.1), PatchSettings(), random(0))) == 0


@settings(max_examples=10)
@given(st.integers(0, 2**32))
def test_random_places_are_in_the_picture_and_on_the_mesh(seed):
    observation = observation_of(VIEW)
    found = random_places(observation, VIEW, PatchSettings(random=5), random(seed))
    assert len(found) <= 5
    assert (np.hypot(*found.centers.T[:2]) < observation.manifest.max_distance).all()
    pixels = VIEW.ray_pixels(found.centers / np.linalg.norm(found.centers, axis=1, keepdims=True))
    assert ((pixels >= -0.5) & (pixels <= np.array(VIEW.size) - 0.5)).all()


def test_proposals_are_at_the_balls():
    observation = test_looking.observed(NEAR, FAR)
    view = observation.view
    found = PatchPlaces.of(view.shape.center_along(observation.peaks["ball"].rays, view.height))
    labels = label_places(found.tangents(test_looking.VIEW), truths(NEAR, FAR))
    assert set(labels.of) >= {0, 1}


@pytest.mark.parametrize("factor", [0.8, 1.0, 1.25])
def test_a_patch_that_is_cut_larger_shows_a_smaller_ball_and_its_target_says_so(factor):
    places = PatchPlaces(NEAR[None], np.array([factor]))
    patch = places.cut(observation_of(VIEW, NEAR).pyramid, VIEW, PatchSettings(size=64, extent=2.0))[0, :, :, 0]
    radius = np.sqrt((patch > 127).sum() / np.pi) / 64 * 4.0  # in expected radii
    assert radius == pytest.approx(1.0 / factor, rel=0.02)
    found = label_places(places.tangents(VIEW), truths(NEAR))
    assert np.exp(found.targets[0, 2]) == pytest.approx(1.0 / factor, rel=1e-5)


@settings(max_examples=10)
@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(0.85, 1.15))
def test_the_ball_in_a_patch_is_where_its_targets_say(right, down, factor):
    ray = Tangents.at(VIEW, NEAR[None]).rays(np.array([right]), np.array([down]))
    places = PatchPlaces(BALL.center_along(ray, VIEW.height), np.array([factor]))
    patch = places.cut(observation_of(VIEW, NEAR).pyramid, VIEW, PatchSettings(size=48, extent=2.0))[0, :, :, 0]
    patch = patch.astype(float)
    target = label_places(places.tangents(VIEW), truths(NEAR)).targets[0]
    at = (np.arange(48) + 0.5) / 48 * 4.0 - 2.0
    assert (patch.sum(axis=0) @ at) / patch.sum() == pytest.approx(target[0], abs=0.03)
    assert (patch.sum(axis=1) @ at) / patch.sum() == pytest.approx(target[1], abs=0.03)


def test_places_of_no_proposals_can_be_cut():
    places = PatchPlaces.of(np.empty((0, 3)))
    assert places.cut(observation_of(VIEW).pyramid, VIEW, PatchSettings(size=16)).shape == (0, 16, 16, 3)
