"""Proposals: a place for each object, best first, apart from each other, and not more than asked for."""

from dataclasses import replace

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from vm_embedded.detection.patches import Tangents
from vm_embedded.detection.proposals import propose_places
from vm_train.look.labels import Truths, label_places

from .views import BALL, SIZE, center_at, observation_of, view_at

BLACK = np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)
places = st.tuples(st.floats(30.0, SIZE[0] - 30.0), st.floats(30.0, SIZE[1] - 30.0))


def proposed(observation, above=0.03, most=40, probabilities=None, shifts=None):
    p = observation.slot_probabilities[:, 0] if probabilities is None else probabilities
    return propose_places(observation, p, above, most, shifts)


def shifts_to(observation, *centers):
    """Shifts (m, 2) of all slots to the nearest of these centers."""
    view = observation.view
    from_points = Tangents.at(view, BALL.center_along(view.layout.rays, view.height))
    found = label_places(from_points, Truths(np.array(centers), np.full(len(centers), 0.1), np.ones(len(centers))))
    return found.targets[:, :2]


def apart(view, pixels):
    """Centers (c, 3) of balls at these pixels that are near enough and apart; the example is left out without any."""
    centers = [center_at(view, pixel) for pixel in pixels]
    centers = np.array([each for each in centers if np.isfinite(each).all() and np.linalg.norm(each) < 6.0])
    assume(len(centers))
    rays = centers / np.linalg.norm(centers, axis=1, keepdims=True)
    assume((BALL.offset(rays, centers, view.height) + 10.0 * np.eye(len(centers))).min() > 4.0)
    # A ball that covers the point below the camera has too few points there to have a middle.
    assume((np.hypot(centers[:, 0], centers[:, 1]) > 0.3).all())
    return centers


@given(st.lists(places, min_size=1, max_size=5), st.floats(0.4, 1.5), st.floats(0.2, 1.2))
def test_every_ball_has_a_proposal_close_to_its_center(pixels, height, pitch):
    view = view_at(height, pitch)
    centers = apart(view, pixels)
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


@given(st.lists(places, min_size=1, max_size=4), st.floats(0.4, 1.5), st.floats(0.2, 1.2))
def test_shifts_to_the_centers_give_one_exact_proposal_for_each_ball(pixels, height, pitch):
    view = view_at(height, pitch)
    centers = apart(view, pixels)
    observation = observation_of(view, *centers, image=BLACK)
    points = observation.layout.rays[observation.projected.on_screen]
    assume((BALL.offset(points, centers, height) < 0.6).any(axis=1).all())
    shifts = shifts_to(observation, *centers)
    known = np.where(shifts.any(axis=1), observation.slot_probabilities[:, 0], 0.0).astype(np.float32)
    found = proposed(observation, probabilities=known, shifts=shifts)
    assert len(found) == len(centers)
    offset = BALL.offset(found / np.linalg.norm(found, axis=1, keepdims=True), centers, height)
    assert (offset.min(axis=1) < 0.02).all()


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 1e30))
def test_shifts_of_a_damaged_network_lead_to_finite_places(seed, largest):
    view = view_at(pitch=0.05)
    observation = observation_of(view, image=BLACK, background=0.5)
    shifts = np.random.default_rng(seed).uniform(-largest, largest, (len(view.layout), 2)).astype(np.float32)
    found = proposed(observation, shifts=shifts)
    assert len(found) <= 40
    assert np.isfinite(found).all()


def test_shifts_are_only_for_their_class():
    observation = observation_of(view_at(), image=BLACK)
    shifts = np.zeros((len(observation.layout), 2), np.float32)
    shifted = replace(observation, slot_shifts=shifts, manifest=replace(observation.manifest, shifts="ball"))
    assert shifted.shifts_to("ball") is shifts
    assert shifted.shifts_to("robot") is None
    assert observation.shifts_to("ball") is None
