from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.detection.candidates import clusters, graph_diameter, wider_than
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.mesh.models import build_mesh

from ..strategies import reals, seeds


def linked(neighbors):
    """The graph of a neighbor table."""
    return Mesh(np.zeros((len(neighbors) - 1, 3)), neighbors)


@st.composite
def graphs(draw):
    """Neighbor tables of random graphs, one-directional links among them, and some of their points."""
    random = np.random.default_rng(draw(seeds))
    count, width = draw(st.integers(0, 60)), draw(st.integers(1, 6))
    neighbors = random.integers(0, count + 1, (count + 1, width))
    # Sparse graphs have many components: most links lead to the off-screen point.
    neighbors[random.random(neighbors.shape) < draw(reals(0.0, 1.0))] = count
    neighbors[count] = count
    return neighbors.astype(np.int32), np.flatnonzero(random.random(count) < draw(reals(0.0, 1.0)))


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


def plain_components(neighbors, members):
    links = plain_links(neighbors, members)
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
    found = clusters(linked(graph[0]), graph[1])
    assert sorted(part.tolist() for part in found) == sorted(plain_components(*graph))


@given(graphs())
def test_clusters_come_largest_first_with_their_points_ascending(graph):
    found = clusters(linked(graph[0]), graph[1])
    sizes = [len(part) for part in found]
    assert sizes == sorted(sizes, reverse=True)
    assert all((np.diff(part) > 0).all() for part in found)


@given(graphs(), seeds)
def test_the_order_of_the_members_is_that_within_clusters_and_decides_ties(graph, seed):
    neighbors, members = graph
    members = np.random.default_rng(seed).permutation(members)
    rank = {int(point): place for place, point in enumerate(members)}
    found = [[rank[int(point)] for point in part] for part in clusters(linked(neighbors), members)]
    assert sorted(sorted(members[part].tolist()) for part in found) == sorted(plain_components(neighbors, members))
    assert all(part == sorted(part) for part in found)
    assert found == sorted(found, key=lambda part: (-len(part), part[0]))


@given(graphs())
def test_every_positive_point_is_in_exactly_one_cluster(graph):
    neighbors, members = graph
    found = clusters(linked(neighbors), members)
    together = np.concatenate([*found, np.array([], dtype=int)])
    np.testing.assert_array_equal(np.sort(together), members)


@given(reals(0.3, 1.5), reals(0.05, 0.6), seeds)
def test_clusters_of_a_ring_mesh_are_its_connected_components(height, share, seed):
    mesh = build_mesh(Sphere(0.1), height, 2.0, 1.5)
    members = np.flatnonzero(np.random.default_rng(seed).random(len(mesh)) < share)
    found = clusters(mesh, members)
    assert sorted(part.tolist() for part in found) == sorted(plain_components(mesh.neighbors, members))


@pytest.mark.parametrize("forwards", [True, False])
@given(st.integers(1, 300), seeds)
def test_a_chain_of_one_way_links_is_one_cluster(forwards, count, seed):
    """However long, and in whatever order its points are numbered."""
    order = np.random.default_rng(seed).permutation(count)
    neighbors = np.full((count + 1, 1), count, dtype=np.int32)
    for one, other in pairwise(order if forwards else order[::-1]):
        neighbors[one] = other
    (found,) = clusters(linked(neighbors), np.arange(count))
    np.testing.assert_array_equal(found, np.arange(count))


def test_points_that_share_only_the_off_screen_point_are_not_connected():
    neighbors = np.full((4, 6), 3, dtype=np.int32)
    assert [part.tolist() for part in clusters(linked(neighbors), np.arange(3))] == [[0], [1], [2]]


def test_points_linked_through_a_negative_one_are_not_connected():
    neighbors = np.array([[1], [2], [1], [3]], dtype=np.int32)
    assert [part.tolist() for part in clusters(linked(neighbors), np.array([0, 2]))] == [[0], [2]]


def test_nothing_positive_is_no_cluster():
    mesh = build_mesh(Sphere(0.1), 0.8, 1.0, 1.0)
    nothing = np.array([], dtype=np.intp)
    assert clusters(mesh, nothing) == []
    assert clusters(linked(np.zeros((1, 6), dtype=np.int32)), nothing) == []


def chain(count, closed, random):
    """Neighbor table of a chain whose points are numbered in any order, and its diameter."""
    order = random.permutation(count)
    neighbors = np.full((count + 1, 2), count, dtype=np.int32)
    for one, other in pairwise(order):
        neighbors[one, 1] = other
        if random.random() < 0.5:  # some links go both ways
            neighbors[other, 0] = one
    if closed:
        neighbors[order[-1], 1] = order[0]
    return neighbors, count // 2 if closed else count - 1


@given(st.integers(1, 40), st.booleans(), seeds)
def test_the_diameter_of_a_chain_is_its_length(count, closed, seed):
    neighbors, expected = chain(count, closed, np.random.default_rng(seed))
    assert graph_diameter(linked(neighbors), np.arange(count), limit=100) == expected


MESH = build_mesh(Sphere(0.1), 0.8, 4.0, 2.0)


def disk(width, random):
    """Points within `width` [rad] of a random one of MESH, in any order, and which of them is in the middle."""
    center = MESH.rays[random.integers(len(MESH))]
    members = random.permutation(np.flatnonzero(MESH.rays @ center >= np.cos(width)))
    return members, int(np.argmax(MESH.rays[members] @ center))


@given(seeds, reals(0.01, 0.12))
def test_the_diameter_of_a_disk_is_at_most_two_steps_short(seed, width):
    members, _ = disk(width, np.random.default_rng(seed))
    found = graph_diameter(MESH, members, limit=1000)
    exact = plain_diameter(MESH.neighbors, members)
    assert exact - 2 <= found <= exact


@given(graphs(), st.integers(0, 8))
def test_the_diameter_is_never_too_large_and_stops_after_the_limit(graph, limit):
    neighbors, positive = graph
    for members in clusters(linked(neighbors), positive):
        exact = plain_diameter(neighbors, members)
        found = graph_diameter(linked(neighbors), members, limit)
        assert found <= min(exact, limit + 1)
        assert 2 * found >= min(exact, limit + 1)  # no sweep can miss more than half


@given(st.integers(2, 60), st.integers(0, 70), seeds)
def test_counting_stops_one_step_after_the_limit(count, limit, seed):
    order = np.random.default_rng(seed).permutation(count)
    neighbors = np.full((count + 1, 1), count, dtype=np.int32)
    for one, other in pairwise(order):
        neighbors[one] = other
    assert graph_diameter(linked(neighbors), np.arange(count), limit) == min(count - 1, limit + 1)


def test_one_point_is_no_step_wide():
    assert graph_diameter(MESH, np.array([17]), limit=10) == 0


def test_the_diameter_goes_through_members_only():
    """A ring with a gap is a chain, though the gap could be crossed through its middle."""
    ring = np.flatnonzero(MESH.rays[:, 2] == MESH.rays[200, 2])
    members = ring[2:]
    assert graph_diameter(MESH, members, limit=1000) == len(members) - 1


@given(st.integers(1, 40), st.booleans(), st.integers(0, 45), seeds)
def test_a_chain_is_wider_than_all_that_is_shorter(count, closed, limit, seed):
    """From whichever of its points it is measured."""
    random = np.random.default_rng(seed)
    neighbors, exact = chain(count, closed, random)
    members = random.permutation(count)
    for middle in (0, count // 2, count - 1):
        assert wider_than(linked(neighbors), members, middle, limit) == (exact > limit)


@given(seeds, reals(0.01, 0.12))
def test_a_disk_is_wider_than_what_it_is_wider_than_by_three_steps_and_than_nothing_that_it_is_not(seed, width):
    members, middle = disk(width, np.random.default_rng(seed))
    exact = plain_diameter(MESH.neighbors, members)
    for limit in range(exact + 3):
        found = wider_than(MESH, members, middle, limit)
        assert not (found and exact <= limit)
        assert found or exact <= limit + 2


@given(graphs(), st.integers(0, 8), seeds)
def test_nothing_is_called_wider_than_its_diameter_or_less_than_half_as_wide(graph, limit, seed):
    neighbors, positive = graph
    random = np.random.default_rng(seed)
    for members in clusters(linked(neighbors), random.permutation(positive)):
        exact = plain_diameter(neighbors, members)
        found = wider_than(linked(neighbors), members, int(random.integers(len(members))), limit)
        assert not (found and exact <= limit)
        assert found or exact <= 2 * limit


def test_a_cluster_that_is_small_around_its_middle_is_not_wide():
    """One sweep must tell: what two from an end would find is not asked for."""
    members = np.append(MESH.neighbors[700], 700)
    assert not wider_than(MESH, members, middle=6, limit=2)
    assert wider_than(MESH, members, middle=6, limit=1)
    assert not wider_than(MESH, np.array([17]), middle=0, limit=0)
