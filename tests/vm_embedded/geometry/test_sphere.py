import math

import numpy as np
import pytest
from hypothesis import given

from vm_embedded.errors import GeometryError
from vm_embedded.geometry.shapes import Sphere

from ..strategies import reals

radii = reals(0.02, 0.5)
clearances = reals(1.05, 30.0)
"""Height of the camera in units of the least height that has a mesh."""


def reachable(shape, height):
    """An n that lies about 1000 heights out, beyond which tan(phi) has few digits."""
    return float(shape.n(math.atan(1000.0), height))


@given(radii, clearances, reals(0.0, 1.0))
def test_phi_of_n_and_n_plus_one_are_the_tangents_of_one_sphere_on_the_plane(radius, clearance, fraction):
    sphere, height = Sphere(radius), 2.0 * radius * clearance
    n = fraction * float(sphere.n(math.atan(100.0), height))
    near, far = (float(sphere.phi(each, height)) for each in (n, n + 1.0))
    down = height - radius  # from the camera to the height of the sphere's center
    # The center whose distance from the nearer ray is the radius; then that from the farther one must be, too.
    x = (radius + down * math.sin(near)) / math.cos(near)
    assert abs(x * math.cos(far) - down * math.sin(far)) == pytest.approx(radius, rel=1e-6)
    assert math.atan2(x, down) == pytest.approx(0.5 * (near + far), rel=1e-6)


@given(radii, clearances)
def test_theta_of_a_sphere_falls_at_one_half_by_the_width_of_a_sphere_below(radius, clearance):
    """The width beyond n = 0.5 is 2 asin(r / ((h - r) tan(phi))), which is not pi there: as in the reference."""
    sphere, height = Sphere(radius), 2.0 * radius * clearance
    below, beyond = (float(sphere.theta(n, height)) for n in (0.5, 0.5 + 1e-9))
    fall = 2.0 * math.asin(radius / (height - radius))
    assert below - beyond == pytest.approx(fall, abs=1e-6)


@given(radii, clearances, reals(0.5 + 1e-6, 50.0))
def test_theta_of_a_sphere_is_that_of_its_shadow_around_the_vertical(radius, clearance, n):
    sphere, height = Sphere(radius), 2.0 * radius * clearance
    n = min(n, reachable(sphere, height))
    expected = 2.0 * math.asin(min(radius / ((height - radius) * math.tan(float(sphere.phi(n, height)))), 1.0))
    assert float(sphere.theta(n, height)) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("height", [0.2, 0.1, 0.0, -1.0, math.nan, math.inf])
def test_a_camera_not_above_the_ball_is_refused(height):
    sphere = Sphere(0.1)
    for formula in (sphere.spacing, lambda h: sphere.phi(1.0, h), lambda h: sphere.n(0.3, h)):
        with pytest.raises(GeometryError, match="height"):
            formula(height)
    with pytest.raises(GeometryError, match="height"):
        sphere.theta(2.0, height)


def test_one_bad_height_of_many_is_refused():
    with pytest.raises(GeometryError, match="height"):
        Sphere(0.1).spacing(np.array([1.0, 0.15]))
