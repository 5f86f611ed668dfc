import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import GeometryError
from vm_embedded.geometry.shapes import Circle, Cylinder, Sphere
from vm_embedded.mesh.models import build_mesh, mesh_model
from vm_embedded.mesh.walls import wall_distances

from ..brute_force import STEPS
from ..strategies import reals

GOAL_POST, LOW_POST = Cylinder(0.05, 1.8), Cylinder(0.06, 0.9)
POSTS = [*((GOAL_POST, height) for height in (0.5, 0.7, 0.9, 1.2)), (LOW_POST, 1.2)]
"""Posts, and heights [m] they are seen from: below the top, half way up, and above."""

NEAR, FAR = 0.3, 10.0
"""Least distance [m] that a wall serves, and the maximum distance."""

posts = pytest.mark.parametrize(("post", "height"), POSTS)
intersections = pytest.mark.parametrize("k", [3.0, 4.0, 6.0, 8.0])


def walls_of(mesh, k):
    """Rays (rows, points, 3) of each wall of a mesh: its rows are as long as the way around, link by link."""
    rows, walls, first = round(k), [], 0
    while first < len(mesh):
        point, count = mesh.neighbors[first, 3], 1
        while point != first:
            point, count = mesh.neighbors[point, 3], count + 1
        walls.append(mesh.rays[first : first + rows * count].reshape(rows, count, 3))
        first += rows * count
    assert first == len(mesh)
    return walls


@st.composite
def walled(draw):
    """A small mesh of walls: cylinder, camera height, intersections, maximum distance."""
    post = Cylinder(draw(reals(0.02, 0.25)), draw(reals(0.1, 3.0)))
    return post, draw(reals(0.05, 3.0)), draw(reals(2.0, 6.0)), draw(reals(0.31, 3.0))


@given(walled())
def test_walls_are_k_rows_from_the_plane_to_the_top(case):
    """And k points, or a little more, across an object that stands at the wall."""
    post, height, k, max_distance = case
    mesh = build_mesh(*case, "wall6")
    walls, distances = walls_of(mesh, k), wall_distances(post, k, max_distance)
    assert len(walls) == len(distances)
    np.testing.assert_allclose(np.linalg.norm(mesh.rays, axis=1), 1.0, atol=1e-12)
    for rays, distance in zip(walls, distances, strict=True):
        rows, count = rays.shape[:2]
        points = rays * (distance / np.hypot(rays[:, :, 0], rays[:, :, 1]))[:, :, None]
        expected = (np.arange(rows) + 0.5) * post.object_height / rows - height
        np.testing.assert_allclose(points[:, :, 2], np.tile(expected[:, None], (1, count)), atol=1e-9)
        across = count * 2.0 * math.asin(post.radius / distance) / (2.0 * math.pi)
        assert k * (1.0 - 1e-9) <= across < k + 2.0 * math.asin(post.radius / distance) / (2.0 * math.pi)


@given(walled())
def test_rows_lie_half_a_gap_apart(case):
    """Left is a gap less around the vertical, top-left half a gap, top-right half a gap more."""
    mesh = build_mesh(*case, "wall6")
    angle = np.append(np.arctan2(mesh.rays[:, 1], mesh.rays[:, 0]), np.nan)
    gap = np.concatenate(
        [np.full(rays[..., 0].size, 2.0 * math.pi / rays.shape[1]) for rays in walls_of(mesh, case[2])]
    )
    for direction, steps in enumerate([-1.0, -0.5, 0.5, 1.0, 0.5, -0.5]):
        there = mesh.neighbors[:-1, direction]
        off = (angle[there] - angle[:-1] - steps * gap)[there < len(mesh)]
        np.testing.assert_allclose(np.cos(off), 1.0, atol=1e-12)


@given(walled())
def test_links_stay_within_their_wall_and_are_mutual(case):
    """Rows are closed; the lowest and the highest lead to the missing point."""
    mesh = build_mesh(*case, "wall6")
    neighbors, missing = mesh.neighbors, len(mesh)
    assert neighbors.shape == (missing + 1, 6)
    assert neighbors.min() >= 0
    assert neighbors.max() == missing
    assert (neighbors[-1] == missing).all()
    points, steps = np.arange(missing), STEPS[6]
    for direction, (right, up) in enumerate(steps):
        there = neighbors[:-1, direction]
        linked = there < missing
        np.testing.assert_array_equal(neighbors[there[linked], steps.index((-right, -up))], points[linked])
    first = 0
    for rays in walls_of(mesh, case[2]):
        rows, count = rays.shape[:2]
        own = neighbors[first : first + rows * count].reshape(rows, count, 6)
        inside = (own >= first) & (own < first + rows * count)
        assert (inside | (own == missing)).all()
        for direction, (_, up) in enumerate(steps):
            expected = np.ones((rows, count), dtype=bool)
            if up:
                expected[-1 if up > 0 else 0] = False
            np.testing.assert_array_equal(inside[:, :, direction], expected)
        first += rows * count


def half_width(post, distance):
    """Half of the angle [rad] that a post at a distance [m] fills around the vertical."""
    return np.arcsin(post.radius / distance)


def on_post(rays, post, height, distance, bearings):
    """How many points of each row of a wall lie on a post: (bearings, rows), the bearings in [rad]."""
    rows, count = rays.shape[:2]
    # Points of which each row's post takes part, turned until all posts stand in the same place.
    half = math.ceil(2.0 * count * math.asin(post.radius / distance) / (2.0 * math.pi)) + rows
    columns = np.round(bearings / (2.0 * math.pi) * count).astype(int)[:, None] + np.arange(-half, half + 1)
    near = np.moveaxis(rays[:, columns % count], 1, 0)
    cosine, sine = np.cos(bearings)[:, None, None], np.sin(bearings)[:, None, None]
    turned = [cosine * near[..., 0] + sine * near[..., 1], cosine * near[..., 1] - sine * near[..., 0], near[..., 2]]
    center = np.array([[distance, 0.0, post.object_height / 2.0 - height]])
    offset = post.offset(np.stack([axis.reshape(-1) for axis in turned], axis=1), center, height)
    return np.count_nonzero(offset.reshape(near.shape[:3]) < 1.0, axis=2)


def serve_well(counts, k):
    """For which bearings a wall with so many points in its rows (bearings, rows) has k rows, points across, to one."""
    crossed = counts > 0
    order = np.cumsum(crossed, axis=1)
    rows = order[:, -1]
    middle = crossed & (order > 1) & (order < rows[:, None])
    total = np.sqrt(counts.sum(axis=1))

    def near_k(number):
        return (number >= k - 1.0) & (number <= k + 1.0)

    return near_k(rows) & near_k(total) & (near_k(counts) | ~middle).all(axis=1)


@intersections
@posts
def test_at_every_distance_a_wall_has_k_rows_and_k_points_across_a_post(post, height, k):
    """A wall serves what is 1 - 1 / k to 1 + 1 / k times as wide as an object that stands at it."""
    walls, own = walls_of(build_mesh(post, height, k, FAR, "wall6"), k), half_width(post, wall_distances(post, k, FAR))
    bearings = np.random.default_rng(0).uniform(-math.pi, math.pi, 200)
    borders = np.geomspace(NEAR, FAR, len(walls) + 1)
    lost = {}
    for distance in np.sort(np.concatenate([borders, np.geomspace(1.01 * NEAR, 0.99 * FAR, 30)])).tolist():
        serving = np.flatnonzero(np.abs(half_width(post, distance) / own - 1.0) <= 1.0 / k + 1e-9)
        served = [serve_well(on_post(walls[wall], post, height, distance, bearings), k) for wall in serving]
        share = np.any(served, axis=0).mean() if served else 0.0
        if share < 1.0:
            lost[round(distance, 4)] = f"{1.0 - share:.1%}"
    assert not lost, f"share of the bearings without a good wall, by distance [m]: {lost}"


@given(reals(0.01, 0.25), reals(2.0, 10.0), reals(0.31, 50.0))
def test_walls_serve_all_distances(radius, k, max_distance):
    """What they serve leaves no gap from the nearest distance to the farthest."""
    post = Cylinder(radius, 1.0)
    own = half_width(post, wall_distances(post, k, max_distance))
    assert (np.diff(own) < 0.0).all()
    assert own[0] * (1.0 + 1.0 / k) >= half_width(post, NEAR) * (1.0 - 1e-9)
    assert own[-1] * (1.0 - 1.0 / k) <= half_width(post, max_distance) * (1.0 + 1e-9)
    assert (own[1:] * (1.0 + 1.0 / k) >= own[:-1] * (1.0 - 1.0 / k) * (1.0 - 1e-9)).all()


@given(reals(2.0, 10.0), reals(0.31, 50.0))
def test_each_doubling_of_the_distance_takes_the_same_number_of_walls_more(k, max_distance):
    post = Cylinder(0.02, 1.0)
    more = len(wall_distances(post, k, 2.0 * max_distance)) - len(wall_distances(post, k, max_distance))
    # The angle of a thin post halves with each doubling; rounding up a row takes a fiftieth of the room for it.
    assert abs(more - math.log(2.0) / math.log((k + 1.0) / (k - 1.0))) < 1.1


@given(reals(0.02, 0.25), reals(0.1, 3.0), reals(2.0, 10.0), reals(0.01, 1.0), reals(0.1, 20.0))
def test_no_row_is_farther_off_than_the_tolerance(radius, top, k, tolerance, steps):
    """Rows are a k-th of the object's height apart, and lie as much too high as the camera is lower than the mesh's."""
    height = steps * tolerance * top / k
    served = mesh_model("wall6").mesh_height(Cylinder(radius, top), height, k, tolerance)
    assert served > 0.0
    assert abs(served - height) <= tolerance * top / k * (1.0 + 1e-9)


@given(reals(0.02, 3.0), reals(2.0, 10.0))
def test_without_a_tolerance_each_height_has_its_own_mesh(height, k):
    assert mesh_model("wall6").mesh_height(GOAL_POST, height, k, 0.0) == height


def test_few_meshes_serve_all_heights():
    heights = np.linspace(0.3, 1.5, 500)
    served = {mesh_model("wall6").mesh_height(GOAL_POST, height, 4.0, 0.5) for height in heights.tolist()}
    assert len(served) <= math.ceil(1.2 / (1.8 / 4.0)) + 1


@pytest.mark.parametrize("height", [0.3, 1.8 - 1e-9, 1.8, 1.8 + 1e-9, 2.5])
def test_heights_below_at_and_above_the_top_have_the_same_graph(height):
    mesh, usual = (build_mesh(GOAL_POST, each, 4.0, FAR, "wall6") for each in (height, 1.2))
    np.testing.assert_array_equal(mesh.neighbors, usual.neighbors)
    assert np.isfinite(mesh.rays).all()
    assert mesh_model("wall6").rings_across(GOAL_POST, height, 4.0, GOAL_POST, height) == 4.0


@pytest.mark.parametrize("shape", [Sphere(0.1), Circle(0.1)])
def test_walls_are_for_cylinders(shape):
    with pytest.raises(GeometryError, match=f"cylinders, not for a {type(shape).__name__.lower()}"):
        build_mesh(shape, 1.0, 4.0, FAR, "wall6")


@pytest.mark.parametrize(
    ("post", "height", "k", "max_distance", "complaint"),
    [
        (GOAL_POST, 1.0, 1.9, FAR, "at least 2 intersections, not 1.9"),
        (GOAL_POST, 1.0, 4.0, 0.3, r"maximum distance must be above that, not 0\.3 m"),
        (GOAL_POST, 1.0, 4.0, 0.1, "begin at 0.3 m"),
        (Cylinder(0.3, 1.8), 1.0, 4.0, FAR, r"radius must be below that, not 0\.3 m"),
        (Cylinder(1.0, 1.8), 1.0, 4.0, FAR, "radius must be below that, not 1 m"),
        (GOAL_POST, 0.0, 4.0, FAR, "height"),
        (GOAL_POST, -1.0, 4.0, FAR, "height"),
        (GOAL_POST, math.nan, 4.0, FAR, "height"),
        (GOAL_POST, math.inf, 4.0, FAR, "height"),
    ],
)
def test_what_has_no_walls_is_refused(post, height, k, max_distance, complaint):
    with pytest.raises(GeometryError, match=complaint):
        build_mesh(post, height, k, max_distance, "wall6")
