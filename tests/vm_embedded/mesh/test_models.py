import functools
import math

import numpy as np
import pytest

from vm_embedded.errors import GeometryError, InputError
from vm_embedded.geometry.shapes import Cylinder, Sphere
from vm_embedded.mesh.grids import KINDS
from vm_embedded.mesh.models import MESH_MODELS, build_mesh, mesh_model

from ..brute_force import STEPS, plain_mesh, reached

BALL = Sphere(0.095)
CASES = [(h, k, 3.0 if k < 6.0 else 2.0) for h in (0.5, 1.0, 1.2) for k in (1.0, 4.0, 6.0)]
"""Camera height [m], intersections, and a maximum distance [m] that plain Python can walk."""

RINGS = {f"ring{width}": width for width in STEPS}
GRIDS = {f"{kind}grid{width}": (kind, width) for kind in KINDS for width in STEPS}
TWELVE = [*RINGS, *GRIDS]
TOO_MANY = (
    r"would have (far too many|[\d,]+) points, and at most 8,000,000 are allowed; choose .*max_distance.*object_radius"
)

twelve_models = pytest.mark.parametrize("model", TWELVE)
every_model = pytest.mark.parametrize("model", MESH_MODELS)


@functools.cache
def mesh_of(model, height, k, max_distance):
    return build_mesh(BALL, height, k, max_distance, model)


def shape_for(model):
    return Cylinder(0.05, 1.8) if model == "wall6" else BALL


def test_the_twelve_models_of_the_reference_are_there():
    assert set(TWELVE) < set(MESH_MODELS)
    assert len(TWELVE) == 12
    for model in set(MESH_MODELS) - {"octaves"}:
        assert mesh_model(model).neighbors == int(model[-1])


@pytest.mark.parametrize("model", RINGS)
def test_rings_follow_the_conventions(model):
    for height, k, max_distance in CASES:
        mesh = mesh_of(model, height, k, max_distance)
        rays, neighbors = plain_mesh(BALL, height, k, max_distance, RINGS[model])
        assert len(mesh) == len(rays)
        np.testing.assert_allclose(mesh.rays, rays, atol=1e-12)
        np.testing.assert_array_equal(mesh.neighbors, neighbors)


@twelve_models
def test_neighbors_are_points_or_the_missing_one(model):
    for height, k, max_distance in CASES:
        mesh = mesh_of(model, height, k, max_distance)
        assert mesh.neighbors.shape == (len(mesh) + 1, int(model[-1]))
        assert mesh.neighbors.min() >= 0
        assert mesh.neighbors.max() == len(mesh)
        assert (mesh.neighbors[-1] == len(mesh)).all()


@twelve_models
def test_meshes_are_connected(model):
    """From straight below the camera one comes to every point, link by link."""
    for height, k, max_distance in CASES:
        assert reached(mesh_of(model, height, k, max_distance)).all()


@twelve_models
def test_rays_are_unit_vectors_within_the_distance(model):
    for height, k, max_distance in CASES:
        mesh = mesh_of(model, height, k, max_distance)
        np.testing.assert_allclose(np.linalg.norm(mesh.rays, axis=1), 1.0, atol=1e-12)
        level = height if model in RINGS else height - BALL.radius
        assert (
            level * np.hypot(mesh.rays[:, 0], mesh.rays[:, 1]) <= -mesh.rays[:, 2] * max_distance * (1 + 1e-12)
        ).all()
        assert len(np.unique(mesh.rays.round(9), axis=0)) == len(mesh)


@pytest.mark.parametrize("model", RINGS)
def test_left_and_right_in_a_ring_are_mutual(model):
    """Links from ring to ring need not be: their sizes differ."""
    for height, k, max_distance in CASES:
        mesh = mesh_of(model, height, k, max_distance)
        left, right = mesh.neighbors[:-1, 0], mesh.neighbors[:-1, RINGS[model] // 2]
        points = np.arange(1, len(mesh))  # the nadir has no left
        np.testing.assert_array_equal(right[left[points]], points)
        np.testing.assert_array_equal(left[right[points]], points)


@every_model
def test_groups_name_every_neighbor_and_the_point_itself_once(model):
    groups = mesh_model(model).groups
    assert sorted(each for group in groups for each in group) == list(range(-1, mesh_model(model).neighbors))
    assert max(len(group) for group in groups) <= 3


@pytest.mark.parametrize(
    ("name", "nearest"), [("ring5", "ring"), ("xygird6", "xygrid6"), ("cap", "cap6"), ("walls6", "wall6")]
)
def test_an_unknown_model_names_the_nearest(name, nearest):
    with pytest.raises(InputError, match=rf"'{name}'; did you mean '{nearest}.*allowed: ring4, .*wall6"):
        mesh_model(name)
    with pytest.raises(InputError, match=name):
        build_mesh(BALL, 1.0, 4.0, 3.0, name)


@every_model
@pytest.mark.parametrize("wrong", ["height", "intersections", "max_distance"])
def test_numbers_without_a_mesh_are_refused_by_name(model, wrong):
    for value in (0.0, -1.0, math.nan, math.inf):
        numbers = {"height": 1.0, "intersections": 4.0, "max_distance": 3.0} | {wrong: value}
        with pytest.raises(GeometryError, match=wrong.removeprefix("max_")):
            build_mesh(shape_for(model), *numbers.values(), model)


@pytest.mark.parametrize("model", [model for model in MESH_MODELS if model != "wall6"])
@pytest.mark.parametrize(("shape", "height"), [(BALL, 0.19), (Cylinder(0.05, 1.8), 1.8), (Cylinder(0.05, 1.8), 1.2)])
def test_a_camera_not_above_the_object_is_refused(model, shape, height):
    with pytest.raises(GeometryError, match="height"):
        build_mesh(shape, height, 4.0, 3.0, model)


@pytest.mark.parametrize("model", [*TWELVE, "cap6", "octaves"])
@pytest.mark.parametrize(("k", "reach"), [(1e300, 10.0), (2000.0, 10.0), (4.0, 1e300)])
def test_a_mesh_that_fits_no_memory_is_refused(model, k, reach):
    if model.startswith("xy") and k == 4.0:
        return  # its points grow with the logarithm of the distance
    with pytest.raises(GeometryError, match=TOO_MANY):
        build_mesh(Sphere(0.095), 1.0, k, reach, model)


@pytest.mark.parametrize("model", [model for model in MESH_MODELS if model != "wall6"])
def test_a_mesh_within_a_step_is_the_point_below_the_camera(model):
    mesh = build_mesh(BALL, 1.0, 4.0, 1e-3, model)
    if mesh.margin is not None:
        mesh = mesh.part(np.flatnonzero(~mesh.margin))
    np.testing.assert_allclose(mesh.rays, [[0.0, 0.0, -1.0]], atol=1e-15)
    np.testing.assert_array_equal(mesh.neighbors, np.ones((2, mesh_model(model).neighbors)))
