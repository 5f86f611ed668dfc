import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import GeometryError, InputError
from vm_embedded.geometry.shapes import Circle, Cylinder, Sphere
from vm_embedded.mesh.models import MESH_MODELS, build_mesh

from ..brute_force import plain_mesh, reached
from ..strategies import reals

CASES = [
    (Sphere(0.095), 0.8, 6.0, 3.0),
    (Sphere(0.0949996), 1.2, 4.0, 5.0),
    (Sphere(0.11), 0.4, 2.0, 6.0),
    (Sphere(0.1), 0.25, 1.0, 4.0),
    (Sphere(0.11), 0.77, 3.5, 4.0),
    (Circle(0.1), 0.8, 4.0, 2.03),
    (Circle(0.3), 0.5, 2.5, 5.9),
    (Circle(0.05), 1.5, 1.0, 2.03),
    (Cylinder(0.05, 0.4), 0.8, 4.0, 2.9),
    (Cylinder(0.2, 0.7), 1.2, 5.5, 6.0),
]
MODELS = ["ring4", "ring6", "ring8"]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("shape", "height", "k", "max_distance"), CASES)
def test_rings_and_neighbors_follow_the_conventions(shape, height, k, max_distance, model):
    mesh = build_mesh(shape, height, k, max_distance, model)
    rays, neighbors = plain_mesh(shape, height, k, max_distance, MESH_MODELS[model].neighbors)
    assert len(mesh) == len(rays)
    np.testing.assert_allclose(mesh.rays, rays, atol=1e-12)
    np.testing.assert_array_equal(mesh.neighbors, neighbors)


def test_ring6_is_the_model_unless_told_otherwise():
    case = CASES[0]
    np.testing.assert_array_equal(build_mesh(*case).neighbors, build_mesh(*case, "ring6").neighbors)


@st.composite
def meshes(draw, models=tuple(MODELS)):
    """Meshes of up to some ten thousand points, and what they were made of."""
    shape = draw(st.sampled_from([Circle, Sphere]))(draw(reals(0.05, 0.3)))
    height = draw(reals(0.5 if isinstance(shape, Circle) else 2.2 * shape.radius, 2.0))
    k, max_distance, model = draw(reals(0.5, 5.0)), draw(reals(0.2, 4.0)), draw(st.sampled_from(models))
    return build_mesh(shape, height, k, max_distance, model), shape, height, k, max_distance


@given(meshes())
def test_all_neighbors_are_points_or_the_off_screen_one(case):
    mesh = case[0]
    assert mesh.neighbors.shape[0] == len(mesh) + 1
    assert mesh.neighbors.dtype == np.int32
    assert mesh.neighbors.min() >= 0
    assert mesh.neighbors.max() == len(mesh)
    assert (mesh.neighbors[-1] == len(mesh)).all()


@given(meshes())
def test_rays_are_unit_vectors_from_the_nadir_to_the_last_distance(case):
    mesh, _, height, _, max_distance = case
    np.testing.assert_allclose(np.linalg.norm(mesh.rays, axis=1), 1.0, atol=1e-12)
    np.testing.assert_array_equal(mesh.rays[0], [0.0, 0.0, -1.0])
    distance = height * np.hypot(mesh.rays[:, 0], mesh.rays[:, 1]) / -mesh.rays[:, 2]
    assert distance.max() < max_distance * (1.0 + 1e-12)


@given(meshes())
def test_the_ring_after_the_last_one_would_be_too_far(case):
    mesh, shape, height, k, max_distance = case
    rings = len(np.unique(mesh.rays[:, 2]))
    assert height * math.tan(float(shape.phi(rings / k, height))) >= max_distance * (1.0 - 1e-12)


@given(meshes())
def test_an_object_has_k_points_around_the_vertical_on_every_ring(case):
    mesh, shape, height, k, _ = case
    depth, counts = np.unique(mesh.rays[:, 2], return_counts=True)
    order = np.argsort(depth)
    theta = shape.theta(np.arange(1, len(order)) / k, height)
    across = theta * counts[order][1:] / (2.0 * np.pi)
    assert (across >= k * (1.0 - 1e-9)).all()
    assert (across < k + theta / (2.0 * np.pi)).all()


@pytest.mark.parametrize("shape", [Circle(0.1), Sphere(0.1)])
def test_rings_whose_size_is_a_whole_number_have_just_that(shape):
    """Up to n = 1 / 2 ring i has k + 2 i points for a whole k, and float noise must not make it one more."""
    for k in range(2, 60):
        distance = math.tan(float(shape.phi(0.5, 1.0))) * (1.0 + 1e-9)
        depth, counts = np.unique(build_mesh(shape, 1.0, k, distance).rays[:, 2], return_counts=True)
        expected = [1, *(k + 2 * i for i in range(1, k // 2 + 1))]
        assert len(depth) == len(expected)
        np.testing.assert_array_equal(counts, expected)


@given(meshes())
def test_left_and_right_are_mutual(case):
    mesh = case[0]
    width = mesh.neighbors.shape[1]
    left, right = mesh.neighbors[:-1, 0], mesh.neighbors[:-1, width // 2]
    points = np.arange(1, len(mesh))  # the nadir has no left
    np.testing.assert_array_equal(right[left[points]], points)
    np.testing.assert_array_equal(left[right[points]], points)


@given(meshes())
def test_a_ring_is_closed_and_at_one_depth(case):
    mesh = case[0]
    left = mesh.neighbors[1:-1, 0]
    np.testing.assert_array_equal(mesh.rays[left, 2], mesh.rays[1:, 2])


@given(meshes(models=("ring6",)))
def test_every_ring6_mesh_is_connected(case):
    assert reached(case[0]).all()


@given(meshes(models=("ring6",)))
def test_ring6_neighbors_lie_where_their_names_say(case):
    mesh = case[0]
    left, top_left, top_right, right, bottom_right, bottom_left = mesh.neighbors[1:-1].T
    own = mesh.rays[1:]
    rays = np.vstack([mesh.rays, [[np.nan] * 3]])
    for outer in (top_left, top_right):
        exists = outer < len(mesh)
        assert (rays[outer, 2] > own[:, 2])[exists].all()
    for inner in (bottom_right, bottom_left):
        assert (rays[inner, 2] < own[:, 2]).all()
    # The angle around the vertical grows to the right, where a ring has points enough to tell.
    _, ring, counts = np.unique(own[:, 2], return_inverse=True, return_counts=True)
    many = counts[ring] > 4
    for before, after in ((rays[left], own), (own, rays[right])):
        assert (before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] > 0)[many].all()


@given(reals(0.05, 0.2), reals(2.5, 10.0), reals(1.0, 4.0), st.sampled_from([Circle, Sphere]), reals(0.0, 1.0))
def test_the_same_number_of_rings_crosses_an_object_at_every_distance(radius, clearance, k, kind, share):
    shape, height = kind(radius), 2.0 * radius * clearance
    mesh = build_mesh(shape, height, k, 20.0 * height)
    rings = np.unique(np.arccos(np.clip(-mesh.rays[:, 2], -1.0, 1.0)))
    # From beside the nadir to where the object's far end is still within the mesh.
    distance = 1.5 * radius + share * (5.0 * height - 1.5 * radius)
    if kind is Sphere:
        depth = height - radius
        middle, half = math.atan2(distance, depth), math.asin(radius / math.hypot(distance, depth))
        near, far = middle - half, middle + half
    else:
        near, far = math.atan2(distance - radius, height), math.atan2(distance + radius, height)
    assert 0.0 < near < far < rings[-1]
    assert k - 1.0 <= np.count_nonzero((rings > near) & (rings < far)) <= k + 1.0


def test_a_mesh_of_the_nadir_alone_has_no_links():
    mesh = build_mesh(Sphere(0.1), 1.0, 1.0, 0.05)
    assert len(mesh) == 1
    np.testing.assert_array_equal(mesh.neighbors, np.ones((2, 6)))


def test_a_mesh_of_one_ring_leads_nowhere_but_around_and_in():
    mesh = build_mesh(Sphere(0.1), 1.0, 1.0, 0.25)
    assert len(np.unique(mesh.rays[:, 2])) == 2
    count = len(mesh) - 1
    np.testing.assert_array_equal(mesh.neighbors[0], [1 + int(i * count / 6) for i in range(6)])
    np.testing.assert_array_equal(mesh.neighbors[1:-1, 1:3], len(mesh))
    np.testing.assert_array_equal(mesh.neighbors[1:-1, 4:], 0)


@pytest.mark.parametrize("height", [0.2, 0.1, 0.0, -1.0, math.nan, math.inf])
def test_a_camera_that_is_too_low_has_no_mesh(height):
    with pytest.raises(GeometryError, match="height"):
        build_mesh(Sphere(0.1), height, 4.0, 5.0)


def test_an_unknown_model_names_the_nearest():
    with pytest.raises(InputError, match=r"'ring5'.*did you mean.*ring4, ring6, ring8"):
        build_mesh(Sphere(0.1), 1.0, 4.0, 5.0, "ring5")
