"""The border of the field is found, bridged behind things, and missing where the frame does not show it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.field.border import _beyond, _hull, _hulls, find_border

from .ground import behind, ground, inside_of, mesh, turned

FIELD = np.array([[-2.0, -4.0], [5.0, -4.0], [5.0, 4.0], [-2.0, 4.0]])


def labels_of(places, corners):
    return np.where(inside_of(places, corners), "field", "outside")


def error(found, corners):
    """Largest distance [m] from the found corners to the true border's lines."""
    lines = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    away = [np.abs((found - a) @ np.array([(b - a)[1], -(b - a)[0]]) / np.hypot(*(b - a))) for a, b in lines]
    return float(np.min(away, axis=0).max())


@given(angle=st.floats(-3.1, 3.1))
def test_it_is_found_whatever_the_direction_of_the_x_axis(angle):
    places = mesh()
    labels = labels_of(places, FIELD)
    found = find_border(ground(places @ turned(angle), labels))
    assert len(found) >= 3
    assert error(found @ turned(-angle), FIELD) < 0.2  # the mesh resolves 0.34 m there


def test_it_runs_from_right_to_left():
    places = mesh()
    found = find_border(ground(places, labels_of(places, FIELD)))
    azimuths = np.arctan2(found[:, 1], found[:, 0])
    assert (np.diff(azimuths) > 0.0).all()


def test_things_that_hide_it_are_bridged():
    places = mesh()
    free = labels_of(places, FIELD)
    hidden = free.copy()
    for base in ([4.0, 0.0], [3.0, -2.0]):
        hidden[behind(places, base, 0.5, 2.0)] = "outside"
    found = find_border(ground(places, hidden))
    assert error(found, FIELD) < 0.25


def test_a_spot_of_grass_outside_does_not_move_it():
    places = mesh()
    labels = labels_of(places, FIELD)
    azimuths, ranges = np.arctan2(places[:, 1], places[:, 0]), np.hypot(*places.T)
    labels[(np.abs(azimuths - 0.2) < 0.05) & (ranges > 4.0)] = "field"
    labels[(np.abs(azimuths - 0.2) < 0.05) & (ranges > 8.0)] = "outside"
    found = find_border(ground(places, labels))
    assert error(found, FIELD) < 0.25


@pytest.mark.parametrize("what", ["field", "outside"])
def test_there_is_none_if_all_points_are_alike(what):
    places = mesh()
    assert len(find_border(ground(places, np.full(len(places), what)))) == 0


def test_things_on_an_endless_field_are_no_border():
    places = mesh()
    labels = np.full(len(places), "field", dtype="U8")
    labels[behind(places, [3.0, 0.5], 0.5, 2.0)] = "outside"
    labels[behind(places, [4.0, -2.0], 0.5, 2.0)] = "outside"
    assert len(find_border(ground(places, labels))) == 0


def test_no_points_have_no_border():
    assert len(find_border(ground(np.empty((0, 2)), np.empty(0, dtype="U8")))) == 0


@given(noise=st.integers(0, 1000))
def test_it_is_convex(noise):
    places = mesh()
    labels = labels_of(places, FIELD)
    wrong = np.random.default_rng(noise).random(len(places)) < 0.1
    labels[wrong] = np.where(labels[wrong] == "field", "outside", "field")
    steps = np.diff(find_border(ground(places, labels)), axis=0)
    turns = steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0]
    assert (turns > -1e-6).all()


@given(seed=st.integers(0, 1000), count=st.integers(3, 40))
def test_each_hull_is_that_of_all_places_but_some_corners_of_those_before(seed, count):
    random = np.random.default_rng(seed)
    azimuths = np.sort(random.uniform(-1.2, 1.2, count))
    places = (random.uniform(2.0, 6.0, count) * np.exp(1j * azimuths)).tolist()
    left, before = set(range(count)), None
    for corners, beyond in _hulls(places):
        left -= set(before or ()) - set(corners)
        assert corners == _hull(places, sorted(left))
        assert beyond == _beyond(places, corners)
        before = corners
