import math

import numpy as np
import pytest
from hypothesis import given

from vm_embedded.errors import GeometryError
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.mesh.models import build_mesh

from ..strategies import reals, seeds
from .test_rings import CASES, meshes


@given(meshes(), seeds, reals(0.0, 1.0))
def test_part_links_as_a_plain_loop_would(case, seed, share):
    mesh = case[0]
    random = np.random.default_rng(seed)
    count = min(int(share * len(mesh)), 300)
    # Mostly points that are close together, so that links are kept; in any order.
    first = random.integers(0, len(mesh) - count + 1)
    kept = random.permutation(np.arange(first, first + count))
    part = mesh.part(kept)
    place = {int(old): new for new, old in enumerate(kept)}
    expected = [[place.get(int(old), count) for old in mesh.neighbors[point]] for point in kept]
    expected.append([count] * mesh.neighbors.shape[1])
    np.testing.assert_array_equal(part.neighbors, expected)
    np.testing.assert_array_equal(part.rays, mesh.rays[kept])
    assert part.neighbors.dtype == np.int32
    assert len(part) == count


@given(meshes())
def test_the_part_of_everything_is_the_mesh(case):
    mesh = case[0]
    whole = mesh.part(np.arange(len(mesh)))
    np.testing.assert_array_equal(whole.rays, mesh.rays)
    np.testing.assert_array_equal(whole.neighbors, mesh.neighbors)


@given(meshes(), seeds)
def test_the_part_of_a_part_is_a_part(case, seed):
    mesh = case[0]
    random = np.random.default_rng(seed)
    first = np.flatnonzero(random.random(len(mesh)) < 0.7)
    second = np.flatnonzero(random.random(len(first)) < 0.7)
    through, straight = mesh.part(first).part(second), mesh.part(first[second])
    np.testing.assert_array_equal(through.rays, straight.rays)
    np.testing.assert_array_equal(through.neighbors, straight.neighbors)


@given(meshes())
def test_meshes_are_read_only_and_column_by_column(case):
    for mesh in (case[0], case[0].part(np.arange(len(case[0])))):
        assert mesh.rays.flags.f_contiguous
        assert mesh.nbytes == 24 * len(mesh) + 4 * mesh.neighbors.size
        for array in (mesh.rays, mesh.neighbors):
            with pytest.raises(ValueError, match="read-only"):
                array[0, 0] = 0


def test_nothing_of_a_mesh_is_a_mesh():
    empty = build_mesh(*CASES[0]).part(np.array([], dtype=np.intp))
    assert len(empty) == 0
    assert empty.rays.shape == (0, 3)
    np.testing.assert_array_equal(empty.neighbors, np.zeros((1, 6)))


@pytest.mark.parametrize("intersections", [0.0, -2.0, math.nan, math.inf])
def test_intersections_without_a_mesh_are_refused(intersections):
    with pytest.raises(GeometryError, match="intersections"):
        build_mesh(Sphere(0.1), 1.0, intersections, 5.0)


@pytest.mark.parametrize("distance", [0.0, -2.0, math.nan, math.inf])
def test_distances_without_a_mesh_are_refused(distance):
    with pytest.raises(GeometryError, match="distance"):
        build_mesh(Sphere(0.1), 1.0, 4.0, distance)


def test_len_counts_points_without_the_off_screen_one():
    assert len(Mesh(np.zeros((3, 3)), np.zeros((4, 6), dtype=np.int32))) == 3
