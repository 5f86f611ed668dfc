from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.clustering import clusters, graph_diameter
from vm_embedded.mesh import ring_mesh
from vm_embedded.shapes import Sphere

from .strategies import reals, seeds


@st.composite
def graphs(draw):
    """Neighbor tables of random graphs, one-directional links among them, and which points are positive."""
    random = np.random.default_rng(draw(seeds))
    count, width = draw(st.integers(0, 60)), draw(st.integers(1, 6))
    neighbors = random.integers(0, count + 1, (count + 1, width))
    # Sparse graphs have many components: most links lead to the off-screen point.
    neighbors[random.random(neighbors.shape) < draw(reals(0.0, 1.0))] = count
    neighbors[count] = count
    return neighbors.astype(np.int32), random.random(count) < draw(reals(0.0, 1.0))


def plain_links(neighbors, members):
    """For each member the members that are linked with it, in either direction."""
    links = {int(point): set() for point in members}
    for point in links:
        for other in map(int, neighbors[point]):
            if other in links:
                links[point].add(other)
                links[other].add(point)
    return links


def plain_steps(links, start):
    """Steps to every point that can be reached."""
    steps, front = {start: 0}, [start]
    while front:
        ahead = []
        for point in front:
            for other in links[point]:
                if other not in steps:
                    steps[other] = steps[point] + 1
                    ahead.append(other)
        front = ahead
    return steps


def plain_components(neighbors, positive):
    links = plain_links(neighbors, np.flatnonzero(positive))
    components, left = [], set(links)
    while left:
        component = set(plain_steps(links, min(left)))
        components.append(sorted(component))
        left -= component
    return components


def plain_diameter(neighbors, members):
    links = plain_links(neighbors, members)
    return max(max(plain_steps(links, point).values()) for point in links)


@given(graphs())
def test_clusters_are_the_connected_components(graph):
    found = clusters(*graph)
    assert sorted(part.tolist() for part in found) == sorted(plain_components(*graph))


@given(graphs())
def test_clusters_come_largest_first_with_their_points_ascending(graph):
    found = clusters(*graph)
    sizes = [len(part) for part in found]
    assert sizes == sorted(sizes, reverse=True)
    assert all((np.diff(part) > 0).all() for part in found)


@given(graphs())
def test_every_positive_point_is_in_exactly_one_cluster(graph):
    neighbors, positive = graph
    found = clusters(neighbors, positive)
    together = np.concatenate([*found, np.array([], dtype=int)])
    np.testing.assert_array_equal(np.sort(together), np.flatnonzero(positive))


@given(reals(0.3, 1.5), reals(0.05, 0.6), seeds)
def test_clusters_of_a_ring_mesh_are_its_connected_components(height, share, seed):
    mesh = ring_mesh(Sphere(0.1), height, 2.0, 1.5)
    positive = np.random.default_rng(seed).random(len(mesh)) < share
    found = clusters(mesh.neighbors, positive)
    assert sorted(part.tolist() for part in found) == sorted(plain_components(mesh.neighbors, positive))


@pytest.mark.parametrize("forwards", [True, False])
@given(st.integers(1, 300), seeds)
def test_a_chain_of_one_way_links_is_one_cluster(forwards, count, seed):
    """However long, and in whatever order its points are numbered."""
    order = np.random.default_rng(seed).permutation(count)
    neighbors = np.full((count + 1, 1), count, dtype=np.int32)
    for one, other in pairwise(order if forwards else order[::-1]):
        neighbors[one] = other
    (found,) = clusters(neighbors, np.ones(count, dtype=bool))
    np.testing.assert_array_equal(found, np.arange(count))


def test_points_that_share_only_the_off_screen_point_are_not_connected():
    neighbors = np.full((4, 6), 3, dtype=np.int32)
    assert [part.tolist() for part in clusters(neighbors, np.ones(3, dtype=bool))] == [[0], [1], [2]]


def test_points_linked_through_a_negative_one_are_not_connected():
    neighbors = np.array([[1], [2], [1], [3]], dtype=np.int32)
    assert [part.tolist() for part in clusters(neighbors, np.array([True, False, True]))] == [[0], [2]]


def test_nothing_positive_is_no_cluster():
    mesh = ring_mesh(Sphere(0.1), 0.8, 1.0, 1.0)
    assert clusters(mesh.neighbors, np.zeros(len(mesh), dtype=bool)) == []
    assert clusters(np.zeros((1, 6), dtype=np.int32), np.zeros(0, dtype=bool)) == []


@given(st.integers(1, 40), st.booleans(), seeds)
def test_the_diameter_of_a_chain_is_its_length(count, closed, seed):
    random = np.random.default_rng(seed)
    order = random.permutation(count)
    neighbors = np.full((count + 1, 2), count, dtype=np.int32)
    for one, other in pairwise(order):
        neighbors[one, 1] = other
        if random.random() < 0.5:  # some links go both ways
            neighbors[other, 0] = one
    if closed:
        neighbors[order[-1], 1] = order[0]
    expected = count // 2 if closed else count - 1
    assert graph_diameter(neighbors, np.arange(count), limit=100) == expected


MESH = ring_mesh(Sphere(0.1), 0.8, 4.0, 2.0)


@given(seeds, reals(0.01, 0.12))
def test_the_diameter_of_a_disk_is_at_most_two_steps_short(seed, width):
    random = np.random.default_rng(seed)
    center = MESH.rays[random.integers(len(MESH))]
    members = np.flatnonzero(MESH.rays @ center >= np.cos(width))
    found = graph_diameter(MESH.neighbors, members, limit=1000)
    exact = plain_diameter(MESH.neighbors, members)
    assert exact - 2 <= found <= exact


@given(graphs(), st.integers(0, 8))
def test_the_diameter_is_never_too_large_and_stops_after_the_limit(graph, limit):
    neighbors, positive = graph
    for members in clusters(neighbors, positive):
        exact = plain_diameter(neighbors, members)
        found = graph_diameter(neighbors, members, limit)
        assert found <= min(exact, limit + 1)
        assert 2 * found >= min(exact, limit + 1)  # no sweep can miss more than half


@given(st.integers(2, 60), st.integers(0, 70), seeds)
def test_counting_stops_one_step_after_the_limit(count, limit, seed):
    order = np.random.default_rng(seed).permutation(count)
    neighbors = np.full((count + 1, 1), count, dtype=np.int32)
    for one, other in pairwise(order):
        neighbors[one] = other
    assert graph_diameter(neighbors, np.arange(count), limit) == min(count - 1, limit + 1)


def test_one_point_is_no_step_wide():
    assert graph_diameter(MESH.neighbors, np.array([17]), limit=10) == 0


def test_the_diameter_goes_through_members_only():
    """A ring with a gap is a chain, though the gap could be crossed through its middle."""
    ring = np.flatnonzero(MESH.rays[:, 2] == MESH.rays[200, 2])
    members = ring[2:]
    assert graph_diameter(MESH.neighbors, members, limit=1000) == len(members) - 1
