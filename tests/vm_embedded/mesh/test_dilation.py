"""Neighbors farther away: where they lie, on lattices and on rings, and what happens at the edge."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.geometry.sphere import Sphere
from vm_embedded.mesh.dilation import dilated, distinct_dilations, links_across, with_dilations
from vm_embedded.mesh.models import MESH_MODELS, build_mesh
from vm_embedded.network.split_layout import with_surroundings

from ..network.test_layout import random_meshes

RINGS = ("ring4", "ring6", "ring8")
GRIDS = ("xygrid4", "xmgrid6", "xygrid8")
ALL = {model: build_mesh(Sphere(0.1), 0.8, 3.0, 6.0, model) for model in (*RINGS, "cap6", *GRIDS)}

dilations = st.integers(2, 6)


@pytest.mark.parametrize("dilation", [2, 3, 8])
@pytest.mark.parametrize("model", GRIDS)
def test_on_a_lattice_a_neighbor_is_so_many_times_as_many_cells_away(model, dilation):
    mesh, steps = ALL[model], MESH_MODELS[model].steps
    found = dilated(mesh.neighbors, MESH_MODELS[model].groups, dilation)
    point_at = {cell: point for point, cell in enumerate(map(tuple, mesh.cells.tolist()))}
    there = mesh.cells[:, None] + dilation * np.array(steps)
    farther = np.array([[point_at.get(tuple(cell), len(mesh)) for cell in cells] for cells in there.tolist()])
    present = found[:-1] < len(mesh)
    np.testing.assert_array_equal(found[:-1][present], farther[present])
    assert present.sum() > 0.9 * (farther < len(mesh)).sum()  # the others are behind a gap in the outline


@given(st.sampled_from(RINGS), dilations)
def test_on_rings_a_group_lies_so_many_rings_away_and_its_members_as_many_steps_apart(model, dilation):
    mesh, groups = ALL[model], MESH_MODELS[model].groups
    n, inclination = len(mesh), np.arccos(-ALL[model].rays[:, 2])
    rings, ring_of = np.unique(inclination.round(9), return_inverse=True)
    right = mesh.neighbors[:, groups[0][-1]]
    found = dilated(mesh.neighbors, groups, dilation)
    # Below the camera, rings are as small as the steps.
    outside = np.flatnonzero((ring_of > 2 * dilation) & (ring_of < len(rings) - dilation))
    bearing = np.arctan2(mesh.rays[:, 1], mesh.rays[:, 0])
    for group, rows in zip(groups, (0, 1, 1, -1, -1) if model == "ring8" else (0, 1, -1), strict=True):
        members = [found[outside, each] for each in group if each >= 0]
        for each in members:
            assert (ring_of[each] == ring_of[outside] + rows * dilation).all()
        between = members[0]
        for _ in range(dilation * (len(group) - 1)):
            between = right[between]
        np.testing.assert_array_equal(between, members[-1])
        # The middle of the members is straight ahead, within a step for each row.
        middle = np.angle(sum(np.exp(1j * bearing[each]) for each in members))
        off = np.abs(np.angle(np.exp(1j * (middle - bearing[outside]))))
        step = 2.0 * np.pi / np.bincount(ring_of, minlength=len(rings))[ring_of[members[0]]]
        assert np.median(off / step) <= 1.0 + 0.5 * (rows != 0)
    assert (found[n] == n).all()


@given(st.data(), st.sampled_from(sorted(ALL)), dilations)
def test_the_points_are_within_so_many_links(data, model, dilation):
    mesh = data.draw(random_meshes(MESH_MODELS[model].neighbors))
    groups = MESH_MODELS[model].groups
    found = dilated(mesh.neighbors, groups, dilation)
    assert found.dtype == np.int32
    for point in range(min(len(mesh), 20)):
        near = with_surroundings(mesh, np.array([point]), links_across(groups, dilation))
        assert set(found[point].tolist()) <= {*near.tolist(), len(mesh)}


@pytest.mark.parametrize(("model", "links"), [("ring6", 5), ("ring8", 5), ("xygrid4", 3), ("xygrid8", 6)])
def test_the_farthest_points_of_dilation_three(model, links):
    """Three rows up, and there half of three steps to a side with two members in a group, or three with three."""
    assert links_across(MESH_MODELS[model].groups, 3) == links


@pytest.mark.parametrize("model", sorted(ALL))
def test_columns_are_those_of_one_dilation_after_the_other(model):
    neighbors, groups = ALL[model].neighbors, MESH_MODELS[model].groups
    assert with_dilations(neighbors, groups, (1,)) is neighbors
    found = with_dilations(neighbors, groups, (1, 2, 4))
    for columns, dilation in zip(np.split(found, 3, axis=1), (1, 2, 4), strict=True):
        np.testing.assert_array_equal(columns, dilated(neighbors, groups, dilation))
    assert dilated(neighbors, groups, 1) is neighbors


def test_the_different_dilations_begin_with_one_and_ascend():
    assert distinct_dilations(()) == (1,)
    assert distinct_dilations((4, 2, 4, 8)) == (1, 2, 4, 8)
