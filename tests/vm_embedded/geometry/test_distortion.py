import math

import numpy as np
import pytest
from hypothesis import assume, example, given

from vm_embedded.geometry.radial_lenses import distort, monotone_radius, undistort

from ..strategies import RADIUS, distortions, reals, seeds

strong = distortions(strength=1.5)
MUSTACHE = (1e-6, -1e-12)
"""A distortion that pulls inwards first and turns after."""


def turning_point(distortion):
    """Where undistort stops growing, or a radius far outside of a picture."""
    return min(monotone_radius(distortion), 3.0 * RADIUS)


@given(strong, reals(0.0, 1.0))
@example(MUSTACHE, 0.995)
@example(MUSTACHE, 1.0)
def test_distort_is_the_inverse_of_undistort(distortion, fraction):
    """Held against the undistorted radius, which is well-conditioned up to the turning point."""
    undistorted = undistort(fraction * turning_point(distortion), distortion)
    found = distort(np.array([undistorted]), distortion)
    assert undistort(found, distortion)[0] == pytest.approx(undistorted, abs=1e-6)
    assert 0.0 <= found[0] <= monotone_radius(distortion)


@given(strong, reals(0.0, 0.95))
@example(MUSTACHE, 0.9)
def test_distort_finds_the_radius_that_undistort_came_from(distortion, fraction):
    distorted = fraction * turning_point(distortion)
    slope = undistort(distorted + 0.5, distortion) - undistort(distorted - 0.5, distortion)
    assume(slope > 1e-2)
    assert distort(np.array([undistort(distorted, distortion)]), distortion)[0] == pytest.approx(distorted, abs=1e-5)


@given(strong, seeds)
def test_distort_of_many_is_that_of_each(distortion, seed):
    radii = undistort(np.random.default_rng(seed).random(9) * turning_point(distortion), distortion)
    together = distort(radii, distortion)
    np.testing.assert_allclose(together, [distort(radii[i : i + 1], distortion)[0] for i in range(9)], atol=1e-6)


def test_undistort_follows_the_conventions():
    assert undistort(100.0, (2e-6, 3e-11)) == pytest.approx(100.0 * (1.0 + 2e-6 * 1e4 + 3e-11 * 1e8), rel=1e-14)


@given(strong)
def test_monotone_radius_is_where_undistort_stops_growing(distortion):
    turning = monotone_radius(distortion)
    inside = undistort(np.linspace(0.0, min(turning, 1e5), 2000), distortion)
    assert (np.diff(inside) >= 0).all()
    if math.isfinite(turning):
        beyond = undistort(turning * np.array([1.0, 1.001, 1.01]), distortion)
        assert (np.diff(beyond) < 0).all()


@pytest.mark.parametrize("distortion", [(0.0, 0.0), (1e-6, 0.0), (0.0, 1e-12), (1e-6, 1e-12), (-1e-6, 1e-11)])
def test_a_distortion_that_never_folds_has_no_turning_point(distortion):
    assert monotone_radius(distortion) == math.inf


def distort_series(radius, distortion):
    """Approximate inverse of `undistort` as in the reference: four terms of a series in r_u^2.

    The reference states an error of about 0.2 px, which holds only for mild distortion.
    """
    k0, k1 = distortion
    terms = (
        -k0,
        3.0 * k0**2 - k1,
        -12.0 * k0**3 + 8.0 * k0 * k1,
        55.0 * k0**4 - 55.0 * k0**2 * k1 + 5.0 * k1**2,
    )
    square = radius * radius
    factor = 0.0
    for term in reversed(terms):
        factor = (factor + term) * square
    return radius * (1.0 + factor)


@given(distortions(strength=0.02), reals(0.0, RADIUS))
def test_the_series_is_close_for_mild_distortion(distortion, undistorted):
    exact = distort(np.array([undistorted]), distortion)[0]
    assert distort_series(undistorted, distortion) == pytest.approx(exact, abs=0.2)


@given(distortions(strength=1.0), reals(0.05, 1.0))
def test_the_series_converges_with_the_tenth_power_of_the_distortion(distortion, share):
    """The first term left out is of fifth order in r^2, so halving the radius leaves 2^-11 of the error, or so."""
    radius = 0.3 * RADIUS * share
    errors = [abs(distort_series(r, distortion) - distort(np.array([r]), distortion)[0]) for r in (radius, radius / 2)]
    assert errors[1] <= errors[0] / 2.0**9 + 1e-9
