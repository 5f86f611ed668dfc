import math

import numpy as np
import pytest
from hypothesis import given

from vm_embedded.errors import GeometryError
from vm_embedded.geometry.shapes import Circle

from ..strategies import reals

radii = reals(0.02, 0.5)
clearances = reals(1.05, 30.0)
"""Height of the camera in units of the least height that has a mesh."""


@given(radii, clearances, reals(0.0, 200.0))
def test_circles_lie_side_by_side(radius, clearance, n):
    circle, height = Circle(radius), 2.0 * radius * clearance
    near, far = (height * math.tan(circle.phi(each, height)) for each in (n, n + 1.0))
    assert far - near == pytest.approx(2.0 * radius, rel=1e-6)


@given(radii, clearances)
def test_theta_of_a_circle_is_continuous_where_the_circle_begins_to_cover_the_nadir(radius, clearance):
    circle, height = Circle(radius), 2.0 * radius * clearance
    below, beyond = (float(circle.theta(n, height)) for n in (0.5, 0.5 + 1e-9))
    assert below == pytest.approx(math.pi, abs=1e-12)
    assert beyond == pytest.approx(math.pi, abs=2e-4)  # an arcsine starts off vertically


@given(radii, clearances)
def test_rays_into_the_sky_are_on_no_circle(radius, clearance):
    height = 2.0 * radius * clearance
    rays = np.array([[1.0, 0.0, 0.0], [0.6, 0.0, 0.8], [0.0, 0.0, 1.0]])
    assert not (Circle(radius).offset(rays, np.array([[3.0, 0.0, -height]]), height) <= 1.0).any()


@pytest.mark.parametrize("height", [0.0, -1.0, math.nan, math.inf])
def test_a_camera_not_above_the_circle_is_refused(height):
    circle = Circle(0.1)
    for formula in (circle.spacing, lambda h: circle.phi(1.0, h), lambda h: circle.n(0.3, h)):
        with pytest.raises(GeometryError, match="height"):
            formula(height)
