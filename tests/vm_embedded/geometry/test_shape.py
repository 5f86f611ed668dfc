import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import GeometryError
from vm_embedded.geometry.shape import tangents
from vm_embedded.geometry.shapes import SHAPES, Circle, Cylinder, Sphere

from ..strategies import random_direction, reals, seeds

radii = reals(0.02, 0.5)
clearances = reals(1.05, 30.0)
"""Height of the camera in units of the least height that has a mesh."""


def least_height(shape):
    """Height [m] that a camera must be above; of a circle just a length."""
    return shape.object_height if isinstance(shape, Cylinder) else 2.0 * shape.radius


@st.composite
def shapes_and_heights(draw, kinds=(Circle, Sphere, Cylinder)):
    kind, radius = draw(st.sampled_from(kinds)), draw(radii)
    shape = kind(radius, draw(reals(0.05, 2.0))) if kind is Cylinder else kind(radius)
    return shape, least_height(shape) * draw(clearances)


def reachable(shape, height):
    """An n that lies about 1000 heights out, beyond which tan(phi) has few digits."""
    return float(shape.n(math.atan(1000.0), height))


@given(shapes_and_heights(), reals(0.0, 1.0))
def test_n_is_the_inverse_of_phi(case, fraction):
    shape, height = case
    n = fraction * reachable(shape, height)
    assert float(shape.n(shape.phi(n, height), height)) == pytest.approx(n, rel=1e-9, abs=1e-12)


@given(shapes_and_heights(), reals(0.0, 1.5))
def test_phi_is_the_inverse_of_n(case, phi):
    shape, height = case
    assert float(shape.phi(shape.n(phi, height), height)) == pytest.approx(phi, abs=1e-12)


@given(shapes_and_heights())
def test_phi_grows_from_the_nadir_to_the_horizon(case):
    shape, height = case
    phi = shape.phi(np.linspace(0.0, reachable(shape, height), 500), height)
    assert phi[0] == 0.0
    assert (np.diff(phi) > 0).all()
    assert phi[-1] < math.pi / 2


@given(shapes_and_heights(), reals(0.1, 50.0))
def test_phi_follows_the_conventions(case, n):
    shape, height = case
    n = min(n, reachable(shape, height))
    if isinstance(shape, Sphere):
        expected = math.atan(math.sinh(-n * math.log(1.0 - 2.0 * shape.radius / height)))
    elif isinstance(shape, Cylinder):
        top = shape.object_height
        expected = math.atan(2.0 * shape.radius / top * (math.exp(-n * math.log(1.0 - top / height)) - 1.0))
    else:
        expected = math.atan(2.0 * n * shape.radius / height)
    assert float(shape.phi(n, height)) == pytest.approx(expected, rel=1e-12)


@given(shapes_and_heights(), reals(0.0, 0.5))
def test_theta_grows_to_the_whole_circle_at_the_nadir(case, n):
    shape, height = case
    assert float(shape.theta(n, height)) == pytest.approx(2.0 * math.pi / (1.0 + 2.0 * n), rel=1e-12)


@given(shapes_and_heights())
def test_theta_is_finite_and_shrinks_outwards(case):
    shape, height = case
    n = np.linspace(0.0, reachable(shape, height), 5000)
    theta = shape.theta(np.concatenate([n, [0.5 - 1e-12, 0.5, 0.5 + 1e-12, 0.5 + 1e-6]]), height)
    assert np.isfinite(theta).all()
    assert (theta > 0).all()
    assert (np.diff(theta[: len(n)]) < 0).all()


@given(shapes_and_heights())
def test_formulas_work_on_arrays_as_on_numbers(case):
    shape, height = case
    n = np.array([0.0, 0.25, 0.5, 0.75, 3.0])
    for formula in (shape.phi, shape.theta):
        np.testing.assert_array_equal(formula(n, height), [float(formula(each, height)) for each in n])
    phi = np.array([0.0, 0.3, 1.2])
    np.testing.assert_array_equal(shape.n(phi, height), [float(shape.n(each, height)) for each in phi])


@given(shapes_and_heights())
def test_height_of_is_the_inverse_of_spacing(case):
    shape, height = case
    assert shape.height_of(float(shape.spacing(height))) == pytest.approx(height, rel=1e-9)


def spacing_ratio(shape, height, mesh_height):
    """How many rings cross an object seen from `height`, relative to the height that the mesh was made for."""
    return float(shape.spacing(height) / shape.spacing(mesh_height))


@given(radii, clearances, clearances)
def test_spacing_ratio_follows_the_conventions(radius, clearance, mesh_clearance):
    height, mesh_height = 2.0 * radius * clearance, 2.0 * radius * mesh_clearance
    spheres = math.log(1.0 - 2.0 * radius / height) / math.log(1.0 - 2.0 * radius / mesh_height)
    assert spacing_ratio(Sphere(radius), height, mesh_height) == pytest.approx(spheres, rel=1e-9)
    assert spacing_ratio(Circle(radius), height, mesh_height) == pytest.approx(mesh_height / height, rel=1e-12)


@given(shapes_and_heights(), clearances, reals(0.0, 5.0))
def test_spacing_ratio_is_the_number_of_objects_that_one_object_covers(case, mesh_clearance, n):
    """Seen from another height an object spans from n to n + ratio of the mesh that was made for the first."""
    shape, height = case
    mesh_height = least_height(shape) * mesh_clearance
    near, far = (shape.phi(each, height) for each in (n, n + 1.0))
    covered = float(shape.n(far, mesh_height) - shape.n(near, mesh_height))
    assert covered == pytest.approx(spacing_ratio(shape, height, mesh_height), rel=1e-4)


def center_of(shape, height, distance, bearing):
    return np.array([distance * math.cos(bearing), distance * math.sin(bearing), shape.center_height - height])


centers = st.tuples(shapes_and_heights(), reals(0.0, 20.0), reals(-math.pi, math.pi))


@given(centers)
def test_offset_is_0_at_the_center_and_1_on_the_outline(case):
    (shape, height), distance, bearing = case
    center = center_of(shape, height, distance, bearing)
    rays = np.vstack([center / np.linalg.norm(center), shape.outline(center, height, count=36)])
    offset = shape.offset(rays, center[None], height)
    assert offset.shape == (1, 37)
    assert offset[0, 0] == pytest.approx(0.0, abs=1e-4)
    np.testing.assert_allclose(offset[0, 1:], 1.0, atol=1e-4)


@given(centers)
def test_an_object_covers_the_rays_whose_offset_is_less_than_each_share(case):
    (shape, height), distance, bearing = case
    center = center_of(shape, height, distance, bearing)
    rays = np.concatenate([share * shape.outline(center, height) + center for share in (0.5, 2.0, 20.0)])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    shares = np.array([1.0, 0.9])
    together = shape.covers(rays, center[None], height, shares[:, None, None])
    assert together.shape == (2, 1, len(rays))
    for covered, share in zip(together, shares, strict=True):
        np.testing.assert_array_equal(covered, shape.covers(rays, center[None], height, float(share)))


@given(centers)
def test_outline_is_unit_rays_that_touch_the_object(case):
    (shape, height), distance, bearing = case
    center = center_of(shape, height, distance, bearing)
    rays = shape.outline(center, height, count=24)
    assert rays.shape == (24, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0, atol=1e-12)
    if isinstance(shape, Sphere):
        away = np.linalg.norm(np.cross(rays, center), axis=1)
    elif isinstance(shape, Cylinder):  # each touches the upper circle or the lower one
        ends = [center[2] + end * shape.center_height for end in (1.0, -1.0)]
        away = [np.linalg.norm(rays[:, :2] * (end / rays[:, 2:]) - center[:2], axis=1) for end in ends]
        away = np.where(np.abs(away[0] - shape.radius) < np.abs(away[1] - shape.radius), *away)
    else:
        away = np.linalg.norm(rays * (center[2] / rays[:, 2:]) - center, axis=1)
    np.testing.assert_allclose(away, shape.radius, rtol=1e-6)


@given(centers, reals(0.05, 0.95))
def test_offset_is_below_1_inside_of_the_outline_and_above_1_outside(case, inwards):
    (shape, height), distance, bearing = case
    center = center_of(shape, height, distance, bearing)
    outline = shape.outline(center, height, count=16)
    middle = center / np.linalg.norm(center)

    def moved(by):
        rays = middle + by * (outline - middle)
        return rays / np.linalg.norm(rays, axis=1, keepdims=True)

    assert (shape.offset(moved(inwards), center[None], height) < 1.0).all()
    outside = moved(1.0 + inwards)
    assert (shape.offset(outside, center[None], height) > 1.0).all()


@given(shapes_and_heights(), seeds)
def test_offset_of_several_objects_is_that_of_each(case, seed):
    shape, height = case
    random = np.random.default_rng(seed)
    positions = np.stack([center_of(shape, height, *random.uniform(0.0, 5.0, 2)) for _ in range(4)])
    rays = np.stack([random_direction(random) for _ in range(7)])
    together = shape.offset(rays, positions, height)
    assert together.shape == (4, 7)
    for row, position in zip(together, positions, strict=True):
        np.testing.assert_allclose(row, shape.offset(rays, position[None], height)[0], rtol=1e-9)


@given(centers)
def test_center_along_finds_the_object_that_a_ray_points_at(case):
    (shape, height), distance, bearing = case
    center = center_of(shape, height, distance, bearing)
    found = shape.center_along(center[None] / np.linalg.norm(center), height)
    np.testing.assert_allclose(found[0], center, rtol=1e-9, atol=1e-9)


@given(shapes_and_heights())
def test_center_along_a_ray_above_the_horizon_is_finite_and_far(case):
    shape, height = case
    found = shape.center_along(np.array([[1.0, 0.0, 0.0], [0.6, 0.0, 0.8]]), height)
    assert np.isfinite(found).all()
    assert (np.linalg.norm(found[:, :2], axis=1) > 1e5 * (height - shape.center_height)).all()


@given(seeds)
def test_tangents_are_unit_vectors_at_right_angles(seed):
    random = np.random.default_rng(seed)
    for axis in (random_direction(random), np.array([0.0, 0.0, -1.0]), np.array([1e-12, 0.0, 1.0])):
        frame = np.vstack([axis, tangents(axis)])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-9)


@pytest.mark.parametrize("radius", [math.nan, math.inf, 0.0, -0.1])
@pytest.mark.parametrize("kind", SHAPES.values())
def test_a_radius_that_is_no_length_is_refused(kind, radius):
    with pytest.raises(GeometryError, match="radius"):
        kind(radius, 1.0) if kind is Cylinder else kind(radius)
