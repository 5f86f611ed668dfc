import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vm_embedded.errors import GeometryError
from vm_embedded.geometry.shapes import Circle, Sphere

from ..strategies import reals
from .paper_recursions import circle_dtheta, circle_phi1, repeat, sample_radius, sphere_phi_1

radii = reals(0.02, 0.5)
clearances = reals(1.05, 30.0)
PAIRS = [(circle_phi1, Circle), (sphere_phi_1, Sphere)]


@pytest.mark.parametrize(("step", "kind"), PAIRS)
@given(radii, clearances)
def test_the_recursion_iterates_to_the_closed_form(step, kind, radius, clearance):
    height = 2.0 * radius * clearance
    shape = kind(radius)
    count = min(int(shape.n(math.atan(100.0), height)), 300)
    phi = 0.0
    for n in range(1, count + 1):
        phi = step(phi, radius, height)
        assert phi == pytest.approx(float(shape.phi(n, height)), abs=1e-9)


@pytest.mark.parametrize(("step", "kind"), PAIRS)
@given(radii, clearances, reals(0.0, 5.0))
def test_a_step_from_anywhere_is_one_object(step, kind, radius, clearance, n):
    height = 2.0 * radius * clearance
    shape = kind(radius)
    n = min(n, float(shape.n(math.atan(100.0), height)))
    ahead = step(float(shape.phi(n, height)), radius, height)
    assert ahead == pytest.approx(float(shape.phi(n + 1.0, height)), abs=1e-9)


@pytest.mark.parametrize(("step", "kind"), PAIRS)
@given(radii, clearances, st.integers(0, 5), st.integers(0, 5))
def test_repeated_steps_add_up(step, kind, radius, clearance, first, second):
    height = 2.0 * radius * clearance
    halfway = repeat(step, first, 0.0, radius, height)
    assert repeat(step, second, halfway, radius, height) == repeat(step, first + second, 0.0, radius, height)


def test_no_steps_lead_nowhere():
    assert repeat(sphere_phi_1, 0, 0.25, 0.1, 1.0) == 0.25


@given(radii, clearances, reals(0.5 + 1e-6, 100.0))
def test_circle_dtheta_is_the_width_of_a_circle_beyond_the_nadir(radius, clearance, n):
    circle, height = Circle(radius), 2.0 * radius * clearance
    phi = float(circle.phi(n, height))
    assert circle_dtheta(phi, radius, height) == pytest.approx(float(circle.theta(n, height)), rel=1e-9)


@given(radii, clearances, reals(0.0, 0.5 - 1e-6))
def test_circle_dtheta_has_no_answer_where_the_circle_covers_the_nadir(radius, clearance, n):
    height = 2.0 * radius * clearance
    with pytest.raises(GeometryError, match="nadir"):
        circle_dtheta(float(Circle(radius).phi(n, height)), radius, height)


intersections = st.fractions(Fraction(1, 5), Fraction(12), max_denominator=7)


@given(intersections, radii, clearances)
def test_sample_radius_of_spheres_has_a_closed_form(k, radius, clearance):
    """(1 - 2 r0 / h)^q = (1 - 2 r1 / h)^p, solved for r1."""
    height = 2.0 * radius * clearance
    large = math.log1p(-2.0 * radius / height)
    assume(-large * k.denominator < 8.0)  # farther out than 1500 heights phi has few digits left below pi / 2
    expected = -0.5 * height * math.expm1(large / float(k))
    assert sample_radius(k, radius, height, sphere_phi_1) == pytest.approx(expected, rel=1e-9)


@given(intersections, radii, reals(1.05, 200.0))
def test_sample_radius_of_circles_has_a_closed_form(k, radius, height_in_radii):
    """q circles side by side are as wide as p small ones: r1 = r0 q / p, however low the camera."""
    small = sample_radius(k, radius, radius * height_in_radii, circle_phi1)
    assert small == pytest.approx(radius / float(k), rel=1e-9)


@given(intersections, radii, clearances)
def test_small_spheres_put_k_rings_across_a_large_one(k, radius, clearance):
    height = 2.0 * radius * clearance
    small, large = Sphere(sample_radius(k, radius, height)), Sphere(radius)
    n = np.array([0.0, 0.4, 1.0, 2.0])
    covered = small.n(large.phi(n + 1.0, height), height) - small.n(large.phi(n, height), height)
    np.testing.assert_allclose(covered, float(k), rtol=1e-5)


@given(radii, clearances)
def test_one_intersection_needs_spheres_of_the_same_size(radius, clearance):
    assert sample_radius(Fraction(1), radius, 2.0 * radius * clearance) == pytest.approx(radius, rel=1e-12)


@pytest.mark.parametrize("k", [Fraction(0), Fraction(-3, 2)])
def test_intersections_that_are_not_above_zero_are_refused(k):
    with pytest.raises(GeometryError, match="intersections"):
        sample_radius(k, 0.1, 1.0)
