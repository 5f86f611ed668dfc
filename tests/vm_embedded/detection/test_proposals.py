"""Proposals: a place for each object, best first, apart from each other, and not more than asked for."""

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from vm_embedded.detection.proposals import propose_places

from .views import BALL, SIZE, center_at, observation_of, view_at

BLACK = np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)
places = st.tuples(st.floats(30.0, SIZE[0] - 30.0), st.floats(30.0, SIZE[1] - 30.0))


def proposed(observation, above=0.03, most=40, probabilities=None):
    p = observation.slot_probabilities[:, 0] if probabilities is None else probabilities
    return propose_places(observation, p, above, most)


@given(st.lists(places, min_size=1, max_size=5), st.floats(0.4, 1.5), st.floats(0.2, 1.2))
def test_every_ball_has_a_proposal_close_to_its_center(pixels, height, pitch):
    view = view_at(height, pitch)
    centers = [center_at(view, pixel) for pixel in pixels]
    centers = np.array([each for each in centers if np.isfinite(each).all() and np.linalg.norm(each) < 6.0])
    assume(len(centers))
    rays = centers / np.linalg.norm(centers, axis=1, keepdims=True)
    apart = BALL.offset(rays, centers, height) + 10.0 * np.eye(len(centers))
    assume(apart.min() > 4.0)
    # A ball that covers the point below the camera has too few points there to have a middle.
    assume((np.hypot(centers[:, 0], centers[:, 1]) > 0.3).all())
    found = proposed(observation_of(view, *centers, image=BLACK))
    offset = BALL.offset(found / np.linalg.norm(found, axis=1, keepdims=True), centers, height)
    assert (offset.min(axis=1) < 0.5).all()


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.integers(1, 60))
def test_noise_gives_no_more_than_asked_for(seed, share, most):
    view = view_at()
    observation = observation_of(view, image=BLACK)
    random = np.random.default_rng(seed)
    p = np.where(random.random(len(view.layout)) < share, random.random(len(view.layout)), 0.0).astype(np.float32)
    found = proposed(observation, most=most, probabilities=p)
    assert len(found) <= most
    assert np.isfinite(found).all()


def test_without_likely_points_there_is_none():
    assert proposed(observation_of(view_at(), image=BLACK, background=0.02)).shape == (0, 3)


def test_points_off_screen_do_not_count():
    view = view_at()
    observation = observation_of(view, image=BLACK)
    p = np.where(observation.projected.on_screen, 0.0, 1.0).astype(np.float32)
    assert len(proposed(observation, probabilities=p)) == 0


def test_the_most_likely_place_comes_first():
    view = view_at()
    near, far = center_at(view, (200.0, 400.0)), center_at(view, (450.0, 300.0))
    observation = observation_of(view, near, far, image=BLACK)
    p = observation.slot_probabilities[:, 0].copy()
    p[BALL.offset(view.layout.rays, near[None], view.height)[0] < 1.0] = 0.4
    first = proposed(observation, probabilities=p)[0]
    assert np.linalg.norm(first - far) < 0.05
