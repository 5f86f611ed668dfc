import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vm_embedded.errors import GeometryError
from vm_embedded.geometry.shapes import Circle, Cylinder, Sphere
from vm_embedded.mesh.models import build_mesh

from ..brute_force import STEPS, center_height, plain_grid, plain_position
from ..strategies import reals
from .test_models import BALL, CASES, GRIDS, mesh_of


def around_nadir(mesh, width):
    """Column and row of each point from the one straight below the camera: the steps of a path of links to it."""
    (nadir,) = np.flatnonzero(mesh.rays[:, 2] == -1.0).tolist()
    cells, waiting = {nadir: (0, 0)}, [nadir]
    for point in waiting:
        n, m = cells[point]
        for there, (right, up) in zip(mesh.neighbors[point].tolist(), STEPS[width], strict=True):
            if there < len(mesh) and there not in cells:
                cells[there] = n + right, m + up
                waiting.append(there)
    return [cells[point] for point in range(len(mesh))]


def assert_is_flood_filled(mesh, kind, width, shape, height, k, max_distance):
    """The mesh has the plain flood fill's points and links, in any order of points."""
    expected = plain_grid(kind, shape, height, k, max_distance, width)
    cells = around_nadir(mesh, width)
    assert len(cells) == len(expected)
    assert set(cells) == set(expected)
    points = np.array([(*expected[cell], center_height(shape) - height) for cell in cells])
    np.testing.assert_allclose(mesh.rays, points / np.linalg.norm(points, axis=1, keepdims=True), atol=1e-9)
    place = {cell: index for index, cell in enumerate(cells)}
    missing = len(cells)
    links = [[place.get((n + right, m + up), missing) for right, up in STEPS[width]] for n, m in cells]
    np.testing.assert_array_equal(mesh.neighbors, [*links, [missing] * width])


@pytest.mark.parametrize("model", GRIDS)
def test_grids_follow_the_conventions(model):
    for height, k, max_distance in CASES:
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


@pytest.mark.parametrize("model", GRIDS)
def test_links_of_a_grid_are_mutual(model):
    """Who is to the left of a point has it to the right, and so in all directions."""
    steps = STEPS[GRIDS[model][1]]
    for height, k, max_distance in CASES:
        mesh = mesh_of(model, height, k, max_distance)
        points = np.arange(len(mesh))
        for direction, (right, up) in enumerate(steps):
            opposite = steps.index((-right, -up))
            there = mesh.neighbors[:-1, direction]
            linked = there < len(mesh)
            np.testing.assert_array_equal(mesh.neighbors[there[linked], opposite], points[linked])


@pytest.mark.parametrize("model", GRIDS)
def test_a_grid_is_alike_in_all_four_quarters(model):
    for height, k, max_distance in CASES:
        rays = mesh_of(model, height, k, max_distance).rays.round(9) + 0.0
        points = {tuple(ray) for ray in rays.tolist()}
        assert {(-x + 0.0, y, z) for x, y, z in points} == points
        assert {(x, -y + 0.0, z) for x, y, z in points} == points


def test_an_nm_lattice_for_thin_cylinders_has_both_slices_where_they_should_be():
    """There turns do not settle, and halving has to."""
    post, height, k = Cylinder(0.05, 0.5), 0.6, 4.0
    mesh = build_mesh(post, height, k, 3.0, "nmgrid4")
    g, c = height - post.center_height, post.center_height
    x, y = (mesh.rays[:, :2] * (g / -mesh.rays[:, 2:])).T
    columns, rows = np.transpose(around_nadir(mesh, 4))
    for along, other, cell in ((x, y, columns), (y, x, rows)):
        slant = np.hypot(g, other)
        np.testing.assert_allclose(post.n(np.arctan2(along, slant), slant + c), cell / k, atol=1e-6)


@pytest.mark.parametrize("model", GRIDS)
def test_a_lattice_without_end_is_refused(model):
    with pytest.raises(GeometryError, match="at most 8,000,000 are allowed"):
        build_mesh(Circle(1e-4), 1.0, 10.0, 100.0, model)
