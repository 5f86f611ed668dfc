import functools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vm_embedded.geometry.shapes import Circle, Cylinder, Sphere
from vm_embedded.mesh.models import build_mesh

from ..brute_force import plain_rings, reached
from ..strategies import reals

BALL = Sphere(0.095)
FAR = 10.0
"""Maximum distance [m] of meshes on which a ball 5 m away must have its far end."""

CORNERS = ((1, 0), (0, 1), (-1, 1), (-1, 0), (0, -1), (1, -1))
"""The six steps of a hexagonal lattice in axial coordinates, one after the other around the vertical."""

heights = pytest.mark.parametrize("height", [0.5, 1.0, 1.2])
intersections = pytest.mark.parametrize("k", [3.0, 4.0, 6.0])


@functools.cache
def mesh_of(model, height, k, max_distance=FAR):
    return build_mesh(BALL, height, k, max_distance, model)


def ring_sizes(mesh):
    """Points of each ring, the nadir first: how far it is around it, link by link to the right."""
    sizes, first = [1], 1
    while first < len(mesh):
        point, size = mesh.neighbors[first, 3], 1
        while point != first:
            point, size = mesh.neighbors[point, 3], size + 1
        sizes.append(size)
        first += size
    return sizes


def hexagons_of(mesh, rings):
    """How many of a mesh's rings have other sizes than ring6's `rings`, or a hexagon's, from the nadir outwards."""
    sizes = ring_sizes(mesh)
    assert len(sizes) == len(rings)
    last = 0
    while last + 1 < len(sizes) and sizes[last + 1] == 6 * (last + 1):
        last += 1
    assert sizes[last + 1 :] == [count for _, count in rings[last + 1 :]]
    return last


@st.composite
def caps(draw):
    """A small cap mesh, ring6's rings (phi, count) for the same, and k."""
    shape = draw(st.sampled_from([Circle(0.1), Sphere(0.095), Sphere(0.2), Cylinder(0.1, 0.3)]))
    height, k, max_distance = draw(reals(0.5, 1.5)), draw(reals(0.3, 8.0)), draw(reals(0.05, 2.0))
    rings = plain_rings(shape, height, k, max_distance * (1.0 + 1e-9))
    # Where a ring lies on the border, to the last digit, it may be in or out.
    assume(height * math.tan(rings[-1][0]) < max_distance * (1.0 - 1e-9))
    return build_mesh(shape, height, k, max_distance, "cap6"), rings, k


@given(caps())
def test_rings_are_hexagons_inside_and_those_of_ring6_beyond(case):
    mesh, rings, k = case
    last = hexagons_of(mesh, rings)
    assert last >= min(math.floor(k), len(rings) - 1)
    assert reached(mesh).all()


@heights
@intersections
def test_the_cap_ends_where_hexagons_would_be_sparser_than_rings(height, k):
    rings = plain_rings(BALL, height, k, FAR)
    last = hexagons_of(mesh_of("cap6", height, k), rings)
    assert k <= last < len(rings) - 1
    # A ball is as many of its ring's points wide as its share of the circle: k on ring6.
    for i in range(math.floor(k) + 1, last + 1):
        assert k * 6 * i / rings[i][1] >= k - 0.5
    assert k * 6 * (last + 1) / rings[last + 1][1] < k - 0.5


def assert_links_to_the_same_share_of_the_way_around(mesh):
    """Outwards and inwards j / size of the way around, in exact rational arithmetic."""
    sizes = ring_sizes(mesh)
    starts = np.cumsum([0, *sizes]).tolist()
    missing = len(mesh)
    expected = [[1 + i * sizes[1] // 6 for i in range(6)] if len(sizes) > 1 else [missing] * 6]
    for ring in range(1, len(sizes)):
        own, first = sizes[ring], starts[ring]
        before, inwards = sizes[ring - 1], starts[ring - 1]
        for j in range(own):
            top = [missing, missing]
            if ring + 1 < len(sizes):
                after, outwards = sizes[ring + 1], starts[ring + 1]
                top = [outwards + (j * after // own + more) % after for more in (0, 1)]
            bottom = [inwards + (j * before // own + more) % before for more in (1, 0)]
            expected.append([first + (j - 1) % own, *top, first + (j + 1) % own, *bottom])
    expected.append([missing] * 6)
    np.testing.assert_array_equal(mesh.neighbors, expected)


@given(caps())
def test_neighbors_are_those_at_the_same_share_of_the_way_around(case):
    assert_links_to_the_same_share_of_the_way_around(case[0])


@pytest.mark.parametrize(("height", "k", "max_distance"), [(0.46, 1.3, 5.1), (0.65, 1.3, 5.3), (0.5, 6.0, FAR)])
def test_float_noise_moves_no_link(height, k, max_distance):
    """Here j / size times the next ring's size is a whole number that double precision falls short of."""
    assert_links_to_the_same_share_of_the_way_around(mesh_of("cap6", height, k, max_distance))


@intersections
def test_neighbors_in_the_cap_are_those_of_a_hexagonal_lattice(k):
    """Points that are no corners have the lattice's six; a corner has two of its three outwards, and one more inwards.

    Ring i is the hexagon around the nadir whose sides have i points.
    """
    mesh = mesh_of("cap6", 1.0, k)
    last = hexagons_of(mesh, plain_rings(BALL, 1.0, k, FAR))
    cells = [(0, 0)]
    for i in range(1, last + 1):
        for j in range(6 * i):
            side, along = divmod(j, i)
            (a, b), (c, d) = CORNERS[side], CORNERS[(side + 1) % 6]
            cells.append(((i - along) * a + along * c, (i - along) * b + along * d))
    place = {cell: point for point, cell in enumerate(cells)}
    assert len(place) == len(cells) == 1 + 3 * last * (last + 1)
    within = len(cells) - 6 * last  # of the last hexagon the lattice goes on in rings
    for point, (n, m) in enumerate(cells[:within]):
        lattice = {place[n + right, m + up] for right, up in CORNERS}
        ours = set(mesh.neighbors[point].tolist())
        i = max(abs(n), abs(m), abs(n + m))
        if i == 0 or 0 not in (n, m, n + m):
            assert ours == lattice
            continue
        inner, first, outer = (1 + 3 * ring * (ring - 1) if ring else 0 for ring in (i - 1, i, i + 1))
        j = point - first
        side = j // i
        outwards = [outer + j + side, outer + j + side + 1]
        inwards = {inner + (j * (i - 1) // i + more) % max(6 * (i - 1), 1) for more in (0, 1)}
        assert mesh.neighbors[point, 1:3].tolist() == outwards
        assert set(mesh.neighbors[point, 4:].tolist()) == inwards
        assert set(outwards) < lattice
        assert len(ours - lattice) == (1 if i > 1 else 0)


def places_in(mesh, height):
    """Points (n,) as complex numbers, in the plane where a place n objects out lies at the radius n."""
    inclination, angle = np.arccos(-mesh.rays[:, 2]), np.arctan2(mesh.rays[:, 1], mesh.rays[:, 0])
    return np.asarray(BALL.n(inclination, height)) * np.exp(1j * angle)


@pytest.mark.parametrize("k", [4.0, 6.0])
def test_the_middle_of_the_cap_is_a_regular_lattice(k):
    """All six neighbors of a point near the nadir are about as far away, a step or a k-th of an object."""
    mesh = mesh_of("cap6", 1.0, k)
    places = places_in(mesh, 1.0)
    for point in range(7):
        away = k * np.abs(places[mesh.neighbors[point]] - places[point])
        # One of a corner's points inwards is none of the lattice's.
        assert (np.abs(np.sort(away)[: 5 if point else 6] - 1.0) < 0.2).all()


@heights
@intersections
def test_hexagons_have_the_area_of_the_circles_that_they_stand_for(height, k):
    """So the i-th is i / k objects out on average, like ring i: the cap is as dense as the rings."""
    mesh = mesh_of("cap6", height, k)
    places = places_in(mesh, height)
    for i in range(1, hexagons_of(mesh, plain_rings(BALL, height, k, FAR)) + 1):
        ring = places[1 + 3 * i * (i - 1) : 1 + 3 * i * (i + 1)]
        area = 0.5 * np.sum(ring.real * np.roll(ring.imag, -1) - ring.imag * np.roll(ring.real, -1))
        assert area == pytest.approx(math.pi * (i / k) ** 2, rel=0.04)


@heights
@intersections
def test_rays_beyond_the_cap_are_those_of_ring6(height, k):
    cap, ring = mesh_of("cap6", height, k), mesh_of("ring6", height, k)
    rings = plain_rings(BALL, height, k, FAR)
    beyond = sum(count for _, count in rings[hexagons_of(cap, rings) + 1 :])
    assert 0 < beyond < len(cap)
    np.testing.assert_array_equal(cap.rays[-beyond:], ring.rays[-beyond:])


@heights
@intersections
@pytest.mark.parametrize("max_distance", [1.0, 2.0, 5.0, FAR])
def test_there_are_at_most_1_percent_more_points_than_in_ring6(height, k, max_distance):
    cap, ring = mesh_of("cap6", height, k, max_distance), mesh_of("ring6", height, k, max_distance)
    assert len(cap) <= 1.01 * len(ring)


@heights
@intersections
def test_rays_are_unit_vectors_and_all_different(height, k):
    rays = mesh_of("cap6", height, k).rays
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0, atol=1e-12)
    np.testing.assert_array_equal(rays[0], [0.0, 0.0, -1.0])
    assert len(np.unique(rays.round(9), axis=0)) == len(rays)


def points_on_balls(mesh, height, distance, bearings):
    """How many of a mesh's points lie on a ball, for each of its bearings (n,) [rad] at a distance [m]."""
    down = BALL.radius - height
    centers = np.stack([distance * np.cos(bearings), distance * np.sin(bearings), np.full(len(bearings), down)], axis=1)
    middle, half = math.atan2(distance, -down), math.asin(BALL.radius / math.hypot(distance, down))
    lowest, highest = math.cos(min(middle + half, math.pi)), math.cos(max(middle - half, 0.0))
    near = mesh.rays[(-mesh.rays[:, 2] >= lowest - 1e-9) & (-mesh.rays[:, 2] <= highest + 1e-9)]
    return np.count_nonzero(BALL.offset(near, centers, height) < 1.0, axis=1)


@heights
@intersections
def test_a_ball_has_k_points_across_at_every_distance(height, k):
    """The root of the number of points on its disk says how many are in a row; ring6 has too few below the camera."""
    random = np.random.default_rng(0)
    for distance in np.concatenate([np.linspace(0.0, 1.5, 61), np.linspace(1.6, 5.0, 18)]):
        counts = points_on_balls(mesh_of("cap6", height, k), height, distance, random.uniform(-math.pi, math.pi, 40))
        across = np.sqrt(4.0 * counts / math.pi)
        assert across.min() >= k - 1.0, distance
        assert across.max() <= k + 1.0, distance


def test_ring6_has_too_few_points_on_a_ball_below_the_camera():
    below = np.zeros(1)
    for model, enough in (("ring6", False), ("cap6", True)):
        across = math.sqrt(4.0 * points_on_balls(mesh_of(model, 1.0, 4.0), 1.0, 0.0, below)[0] / math.pi)
        assert (across >= 3.0) is enough
