"""The covariance of a detection's place, compared with simulated errors."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.vm_embedded.detection.rolling import CLEAN, detection_at
from vm_embedded.detection.track_settings import TrackSettings
from vm_embedded.detection.tracker import place_errors

NONE = dict.fromkeys(CLEAN, 0.0) | {"pose": 1e-6}


@pytest.mark.long
@settings(max_examples=20)
@given(st.floats(0.3, 4.0), st.floats(-math.pi, math.pi))
def test_simulated_places_have_the_covariance(distance, azimuth):
    random = np.random.default_rng(0)
    place = distance * np.array([math.cos(azimuth), math.sin(azimuth)])
    (expected,) = place_errors([detection_at(place)], TrackSettings())
    off = np.array([detection_at(place, random).position[:2] - place for _ in range(2000)])
    # In units of the expected errors, each direction has a variance of 1, and they are independent.
    units = np.linalg.solve(np.linalg.cholesky(expected), off.T)
    np.testing.assert_allclose(np.cov(units), np.eye(2), atol=0.2)


@pytest.mark.parametrize("name", CLEAN)
def test_each_error_alone_is_in_the_covariance(name):
    random = np.random.default_rng(0)
    alone = NONE | {name: CLEAN[name]}
    chosen = TrackSettings(**{f"{each}_error": value for each, value in alone.items()})
    (expected,) = place_errors([detection_at((2.0, 1.0))], chosen)
    off = [detection_at((2.0, 1.0), random, errors=alone).position[:2] - (2.0, 1.0) for _ in range(4000)]
    np.testing.assert_allclose(np.cov(np.array(off).T), expected, atol=0.1 * expected.max())


def test_the_numbers_of_the_docstring():
    for place, across, along in ((3.0, 0.02, 0.08), (6.0, 0.03, 0.29)):
        (error,) = place_errors([detection_at((place, 0.0))], TrackSettings())
        assert math.sqrt(error[1, 1]) == pytest.approx(across, abs=0.005)
        assert math.sqrt(error[0, 0]) == pytest.approx(along, abs=0.005)


def test_objects_straight_below_and_at_the_horizon_have_finite_errors():
    below = detection_at((0.0, 0.0))
    far = detection_at((1e6, 0.0))
    errors = place_errors([below, far], TrackSettings())
    assert np.isfinite(errors).all()
    assert errors[0, 0, 0] == pytest.approx(errors[0, 1, 1])
    assert place_errors([], TrackSettings()).shape == (0, 2, 2)
