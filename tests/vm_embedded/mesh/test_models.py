import functools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vm_embedded.errors import GeometryError, InputError
from vm_embedded.geometry.circle import Circle
from vm_embedded.geometry.cylinder import Cylinder
from vm_embedded.geometry.sphere import Sphere
from vm_embedded.mesh.grids import KINDS
from vm_embedded.mesh.models import MESH_MODELS, build_mesh, mesh_model

from ..brute_force import STEPS, center_height, plain_grid, plain_mesh, plain_position, reached
from ..strategies import reals

BALL = Sphere(0.095)
CASES = [(h, k, 3.0 if k < 6.0 else 2.0) for h in (0.5, 1.0, 1.2) for k in (1.0, 4.0, 6.0)]
"""Camera height [m], intersections, and a maximum distance [m] that plain Python can walk."""

RINGS = {f"ring{width}": width for width in STEPS}
GRIDS = {f"{kind}grid{width}": (kind, width) for kind in KINDS for width in STEPS}
TWELVE = [*RINGS, *GRIDS]

every_case = pytest.mark.parametrize(("height", "k", "max_distance"), CASES)
twelve_models = pytest.mark.parametrize("model", TWELVE)
every_model = pytest.mark.parametrize("model", MESH_MODELS)


@functools.cache
def mesh_of(model, height, k, max_distance):
    return build_mesh(BALL, height, k, max_distance, model)


def shape_for(model):
    return Cylinder(0.05, 1.8) if model == "wall6" else BALL


def around_nadir(mesh):
    """Columns and rows (n, 2) from the point straight below the camera."""
    (nadir,) = np.flatnonzero(mesh.rays[:, 2] == -1.0)
    return mesh.cells - mesh.cells[nadir]


def assert_is_flood_filled(mesh, kind, width, shape, height, k, max_distance):
    """The mesh has the plain flood fill's points and links, in any order of points."""
    expected = plain_grid(kind, shape, height, k, max_distance, width)
    cells = [tuple(cell) for cell in around_nadir(mesh).tolist()]
    assert len(cells) == len(expected)
    assert set(cells) == set(expected)
    points = np.array([(*expected[cell], center_height(shape) - height) for cell in cells])
    np.testing.assert_allclose(mesh.rays, points / np.linalg.norm(points, axis=1, keepdims=True), atol=1e-9)
    place = {cell: index for index, cell in enumerate(cells)}
    missing = len(cells)
    links = [[place.get((n + right, m + up), missing) for right, up in STEPS[width]] for n, m in cells]
    np.testing.assert_array_equal(mesh.neighbors, [*links, [missing] * width])


def test_the_twelve_models_of_the_reference_are_there():
    assert set(TWELVE) < set(MESH_MODELS)
    assert len(TWELVE) == 12
    for model in MESH_MODELS:
        assert mesh_model(model).neighbors == int(model[-1])


@every_case
@pytest.mark.parametrize("model", RINGS)
def test_rings_follow_the_conventions(model, height, k, max_distance):
    mesh = mesh_of(model, height, k, max_distance)
    rays, neighbors = plain_mesh(BALL, height, k, max_distance, RINGS[model])
    assert len(mesh) == len(rays)
    np.testing.assert_allclose(mesh.rays, rays, atol=1e-12)
    np.testing.assert_array_equal(mesh.neighbors, neighbors)


@every_case
@pytest.mark.parametrize("model", GRIDS)
def test_grids_follow_the_conventions(model, height, k, max_distance):
    mesh = mesh_of(model, height, k, max_distance)
    assert_is_flood_filled(mesh, *GRIDS[model], BALL, height, k, max_distance)


@st.composite
def small_grids(draw):
    """A grid of some hundred points: kind, neighbors, shape, height, intersections, maximum distance."""
    shape = draw(st.sampled_from([Circle(0.1), Circle(0.3), Sphere(0.05), Sphere(0.2), Cylinder(0.1, 0.3)]))
    kind, width = draw(st.sampled_from(list(GRIDS.values())))
    height = draw(reals(1.3, 6.0)) * max(2.0 * center_height(shape), 0.2)
    return kind, width, shape, height, draw(reals(0.2, 3.0)), draw(reals(0.02, 4.0)) * height


@settings(max_examples=100)
@given(small_grids())
def test_grids_of_any_shape_are_flood_filled(case):
    kind, width, shape, height, k, max_distance = case
    # Where a point lies on the border, to the last digit, either side is right.
    points = np.array(list(plain_grid(kind, shape, height, k, max_distance * (1.0 + 1e-9), width).values()))
    assume((np.abs(np.hypot(*points.T) - max_distance) > 1e-9 * max_distance).all())
    mesh = build_mesh(shape, height, k, max_distance, f"{kind}grid{width}")
    assert_is_flood_filled(mesh, kind, width, shape, height, k, max_distance)


def test_cells_may_hang_together_by_their_row_alone():
    """At the end of an axis, where the rows beside it end earlier."""
    case = Sphere(0.1), 0.35, 0.23, 2.2
    assert_is_flood_filled(build_mesh(*case, "nmgrid6"), "nm", 6, *case)


@pytest.mark.parametrize(
    ("kind", "width", "height", "k", "max_distance"), [("nm", 4, 0.38, 0.3, 6.2), ("xm", 6, 0.71, 0.23, 10.0)]
)
def test_a_grid_has_no_islands(kind, width, height, k, max_distance):
    """Far along a diagonal there are places within the distance that no path within it leads to."""
    post = Cylinder(0.1, 0.3)
    mesh = build_mesh(post, height, k, max_distance, f"{kind}grid{width}")
    assert_is_flood_filled(mesh, kind, width, post, height, k, max_distance)
    cells = [(n, m) for n in range(-8, 9) for m in range(-8, 9)]
    near = [math.hypot(*plain_position(kind, post, height, k, width, cell)) <= max_distance for cell in cells]
    assert len(mesh) < sum(near)


@every_case
@twelve_models
def test_neighbors_are_points_or_the_missing_one(model, height, k, max_distance):
    mesh = mesh_of(model, height, k, max_distance)
    assert mesh.neighbors.shape == (len(mesh) + 1, int(model[-1]))
    assert mesh.neighbors.min() >= 0
    assert mesh.neighbors.max() == len(mesh)
    assert (mesh.neighbors[-1] == len(mesh)).all()


@every_case
@twelve_models
def test_meshes_are_connected(model, height, k, max_distance):
    """From straight below the camera one comes to every point, link by link."""
    assert reached(mesh_of(model, height, k, max_distance)).all()


@every_case
@twelve_models
def test_rays_are_unit_vectors_within_the_distance(model, height, k, max_distance):
    mesh = mesh_of(model, height, k, max_distance)
    np.testing.assert_allclose(np.linalg.norm(mesh.rays, axis=1), 1.0, atol=1e-12)
    level = height if model in RINGS else height - BALL.radius
    assert (level * np.hypot(mesh.rays[:, 0], mesh.rays[:, 1]) <= -mesh.rays[:, 2] * max_distance * (1 + 1e-12)).all()
    assert len(np.unique(mesh.rays.round(9), axis=0)) == len(mesh)


@every_case
@pytest.mark.parametrize("model", GRIDS)
def test_links_of_a_grid_are_mutual(model, height, k, max_distance):
    """Who is to the left of a point has it to the right, and so in all directions."""
    mesh = mesh_of(model, height, k, max_distance)
    steps = STEPS[GRIDS[model][1]]
    points = np.arange(len(mesh))
    for direction, (right, up) in enumerate(steps):
        opposite = steps.index((-right, -up))
        there = mesh.neighbors[:-1, direction]
        linked = there < len(mesh)
        np.testing.assert_array_equal(mesh.neighbors[there[linked], opposite], points[linked])


@every_case
@pytest.mark.parametrize("model", RINGS)
def test_left_and_right_in_a_ring_are_mutual(model, height, k, max_distance):
    """Links from ring to ring need not be: their sizes differ."""
    mesh = mesh_of(model, height, k, max_distance)
    left, right = mesh.neighbors[:-1, 0], mesh.neighbors[:-1, RINGS[model] // 2]
    points = np.arange(1, len(mesh))  # the nadir has no left
    np.testing.assert_array_equal(right[left[points]], points)
    np.testing.assert_array_equal(left[right[points]], points)


@pytest.mark.parametrize("model", GRIDS)
def test_a_grid_is_alike_in_all_four_quarters(model):
    for height, k, max_distance in CASES:
        rays = mesh_of(model, height, k, max_distance).rays.round(9) + 0.0
        points = {tuple(ray) for ray in rays.tolist()}
        assert {(-x + 0.0, y, z) for x, y, z in points} == points
        assert {(x, -y + 0.0, z) for x, y, z in points} == points


@every_model
def test_runs_name_every_neighbor_and_the_point_itself_once(model):
    runs = mesh_model(model).runs
    assert sorted(each for run in runs for each in run) == list(range(-1, mesh_model(model).neighbors))
    assert max(len(run) for run in runs) <= 3


@pytest.mark.parametrize(
    ("name", "nearest"), [("ring5", "ring"), ("xygird6", "xygrid6"), ("cap", "cap6"), ("walls6", "wall6")]
)
def test_an_unknown_model_names_the_nearest(name, nearest):
    with pytest.raises(InputError, match=rf"'{name}'; did you mean '{nearest}.*allowed: ring4, .*wall6"):
        mesh_model(name)
    with pytest.raises(InputError, match=name):
        build_mesh(BALL, 1.0, 4.0, 3.0, name)


@every_model
@pytest.mark.parametrize("k", [0.0, -1.0, math.nan, math.inf])
def test_intersections_that_are_no_number_are_refused(model, k):
    with pytest.raises(GeometryError, match="intersections"):
        build_mesh(shape_for(model), 1.0, k, 3.0, model)


@every_model
@pytest.mark.parametrize("max_distance", [0.0, -1.0, math.nan, math.inf])
def test_distances_that_are_no_length_are_refused(model, max_distance):
    with pytest.raises(GeometryError, match="distance"):
        build_mesh(shape_for(model), 1.0, 4.0, max_distance, model)


@every_model
@pytest.mark.parametrize("height", [0.0, -1.0, math.nan, math.inf])
def test_heights_without_a_mesh_are_refused(model, height):
    with pytest.raises(GeometryError, match="height"):
        build_mesh(shape_for(model), height, 4.0, 3.0, model)


@pytest.mark.parametrize("model", [model for model in MESH_MODELS if model != "wall6"])
@pytest.mark.parametrize(("shape", "height"), [(BALL, 0.19), (Cylinder(0.05, 1.8), 1.8), (Cylinder(0.05, 1.8), 1.2)])
def test_a_camera_not_above_the_object_is_refused(model, shape, height):
    with pytest.raises(GeometryError, match="height"):
        build_mesh(shape, height, 4.0, 3.0, model)


@pytest.mark.parametrize("model", [*TWELVE, "cap6"])
@pytest.mark.parametrize(("k", "reach"), [(1e300, 10.0), (2000.0, 10.0), (4.0, 1e300)])
def test_a_mesh_that_fits_no_memory_is_refused(model, k, reach):
    if model.startswith("xy") and k == 4.0:
        return  # its points grow with the logarithm of the distance
    with pytest.raises(GeometryError, match="at most 8,000,000 are allowed"):
        build_mesh(Sphere(0.095), 1.0, k, reach, model)


def test_an_nm_lattice_for_thin_cylinders_has_both_slices_where_they_should_be():
    """There turns do not settle, and halving has to."""
    post, height, k = Cylinder(0.05, 0.5), 0.6, 4.0
    mesh = build_mesh(post, height, k, 3.0, "nmgrid4")
    g, c = height - post.center_height, post.center_height
    x, y = (mesh.rays[:, :2] * (g / -mesh.rays[:, 2:])).T
    middle = mesh.cells[np.argmin(np.hypot(x, y))]
    for along, other, cell in ((x, y, mesh.cells[:, 0] - middle[0]), (y, x, mesh.cells[:, 1] - middle[1])):
        slant = np.hypot(g, other)
        np.testing.assert_allclose(post.n(np.arctan2(along, slant), slant + c), cell / k, atol=1e-6)


@pytest.mark.parametrize("model", GRIDS)
def test_a_lattice_without_end_is_refused(model):
    with pytest.raises(GeometryError, match="at most 8,000,000 are allowed"):
        build_mesh(Circle(1e-4), 1.0, 10.0, 100.0, model)


@pytest.mark.parametrize("model", [model for model in MESH_MODELS if model != "wall6"])
def test_a_mesh_within_a_step_is_the_point_below_the_camera(model):
    mesh = build_mesh(BALL, 1.0, 4.0, 1e-3, model)
    np.testing.assert_allclose(mesh.rays, [[0.0, 0.0, -1.0]], atol=1e-15)
    np.testing.assert_array_equal(mesh.neighbors, np.ones((2, int(model[-1]))))
