"""Laws of the Kalman filter."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.detection.tracker import correct, predict, squared_distances

seeds = st.integers(0, 2**32 - 1)


def covariance(random, size):
    root = random.normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


def state(random):
    return random.normal(size=4), covariance(random, 4)


@given(seeds, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_two_steps_are_one_long_step(seed, first, second):
    random = np.random.default_rng(seed)
    before = state(random)
    twice = predict(*predict(*before, first, 0.7), second, 0.7)
    for one, other in zip(twice, predict(*before, first + second, 0.7), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)


@given(seeds)
def test_the_order_of_two_measurements_at_once_does_not_matter(seed):
    random = np.random.default_rng(seed)
    before, measured = state(random), [(random.normal(size=2), covariance(random, 2)) for _ in range(2)]
    ends = [correct(*correct(*before, *one), *other) for one, other in (measured, measured[::-1])]
    for one, other in zip(*ends, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)


@given(seeds)
def test_a_measurement_is_the_weighted_mean_of_all_that_is_known(seed):
    """The same as least squares, in the form that adds information."""
    random = np.random.default_rng(seed)
    (x, known), place, error = state(random), random.normal(size=2), covariance(random, 2)
    seen = np.eye(2, 4)
    information = np.linalg.inv(known) + seen.T @ np.linalg.inv(error) @ seen
    mean = np.linalg.solve(information, np.linalg.inv(known) @ x + seen.T @ np.linalg.inv(error) @ place)
    after, left = correct(x, known, place, error)
    np.testing.assert_allclose(after, mean, atol=1e-8)
    np.testing.assert_allclose(left, np.linalg.inv(information), atol=1e-8)
    assert np.linalg.eigvalsh(left).min() > 0.0


def test_places_drawn_as_predicted_are_two_squares_off_on_average():
    random = np.random.default_rng(0)
    (x, known), error = state(random), covariance(random, 2)
    places = random.multivariate_normal(x[:2], known[:2, :2] + error, 20_000)
    squares, costs = squared_distances(x, known, places, np.broadcast_to(error, (len(places), 2, 2)))
    assert abs(squares.mean() - 2.0) < 0.05
    np.testing.assert_allclose(costs - squares, np.log(np.linalg.det(known[:2, :2] + error)))
