"""Where the runs of a mesh lie: the laws that a network in layout runs rests on."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.detection.cache import MeshCache
from vm_embedded.detection.settings import Settings
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid, Rectilinear
from vm_embedded.geometry.shapes import Circle, Sphere
from vm_embedded.mesh.mesh import SELF, Mesh
from vm_embedded.mesh.models import MESH_MODELS, build_mesh
from vm_embedded.network import runs_layout
from vm_embedded.network.runs_layout import RunsLayout

from ..strategies import SIZE, reals, seeds
from .test_layout import MODELS, manifest_of, models, random_meshes, ring_meshes


def test_the_example_in_the_docstring():
    """Points 0 1 2 of a ring, below the closed ring of 3 4 5 6; neighbors are left, right and two above."""
    off = 7
    left, right = [off, 0, 1, 6, 3, 4, 5], [1, 2, off, 4, 5, 6, 3]
    above = [[3, 4], [4, 5], [6, 3], *[[off, off]] * 4]
    neighbors = np.vstack([np.column_stack([left, right, above]), np.full(4, off)]).astype(np.int32)
    layout = RunsLayout(Mesh(np.zeros((7, 3)), neighbors), ((0, SELF, 1), (2, 3)))
    points = next(each.split() for each in runs_layout.__doc__.splitlines() if each.startswith("    point"))[1:]
    assert layout.slots.tolist() == [off if each == "-" else int(each) for each in points]
    assert layout.columns[:, 4].tolist() == [5, 31]


def assert_laws_of_runs(mesh, model):
    n, groups = len(mesh), MESH_MODELS[model].groups
    layout = RunsLayout(mesh, groups)
    slots, places, m = layout.slots, layout.places, len(layout.slots)

    np.testing.assert_array_equal(slots[places], np.arange(n))
    assert ((slots >= 0) & (slots <= n)).all()
    assert layout.original.shape == (m,)
    np.testing.assert_array_equal(np.sort(places), np.flatnonzero(layout.original))
    np.testing.assert_array_equal(slots[:3], n)
    np.testing.assert_array_equal(slots[-2:], n)

    # The network's window around slot s stands in column s + 1 of a group's part of the table, m - 1 columns long.
    assert layout.columns.shape == (len(groups), m)
    for number, group in enumerate(groups):
        middle = layout.columns[number] - 1 - number * (m - 1)
        assert middle.min() >= 1
        assert middle.max() + 1 < m - 1
        for offset, neighbor in enumerate(group, start=-(len(group) // 3)):
            wanted = np.arange(n + 1) if neighbor == SELF else mesh.neighbors[:, neighbor]
            np.testing.assert_array_equal(slots[middle + offset], wanted[slots])

    # As a graph the slots are the points; gaps and copies are nobody's neighbors.
    assert len(layout) == m
    np.testing.assert_array_equal(layout.rays, np.append(mesh.rays, np.full((1, 3), np.nan), axis=0)[slots])
    np.testing.assert_array_equal(layout.links(places), np.append(places, m)[mesh.neighbors[:n]])
    some = places[::3]
    np.testing.assert_array_equal(layout.links(some), layout.links(places)[::3])
    np.testing.assert_array_equal(layout.rays[places], mesh.rays)
    return layout


@given(st.data(), models)
def test_groups_of_any_graph_lie_where_columns_say(data, model):
    assert_laws_of_runs(data.draw(random_meshes(MESH_MODELS[model].neighbors)), model)


@given(st.data(), models, seeds)
def test_groups_of_ring_meshes_lie_where_columns_say(data, model, seed):
    mesh, seen = data.draw(ring_meshes(model))
    assert_laws_of_runs(mesh, model)
    assert_laws_of_runs(mesh.part(np.flatnonzero(seen)), model)
    assert_laws_of_runs(mesh.part(np.random.default_rng(seed).permutation(len(mesh))), model)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("shape", [Sphere(0.1), Circle(0.1)], ids=lambda shape: type(shape).__name__)
def test_groups_of_whole_rings_lie_where_columns_say(model, shape):
    layout = assert_laws_of_runs(build_mesh(shape, 0.8, 3.0, 2.0, model), model)
    nadir = layout.places[0]
    assert layout.original[nadir]
    assert layout.slots[nadir] == 0


@given(
    seeds,
    st.sampled_from([model for model in MODELS if "grid" not in model]),  # rows of a grid end oftener
    st.sampled_from([Sphere(0.1), Circle(0.1)]),
    reals(0.5, 1.2),
    reals(0.1, 0.5),
    reals(-0.3, 0.3),
)
def test_few_slots_are_gaps_or_copies_of_a_camera_that_looks_ahead(seed, model, shape, height, pitch, roll):
    random = np.random.default_rng(seed)
    kind = "sphere" if isinstance(shape, Sphere) else "circle"
    facts = manifest_of(model, "runs", shape=kind, radius=shape.radius, intersections=random.uniform(4.0, 8.0))
    lens = [Equisolid(focal_length=400.0, fov=2.4), Rectilinear(focal_length=450.0, fov=2.0)][seed % 2]
    layout = MeshCache(facts, Settings()).view(Orientation.from_roll_pitch(height, roll, pitch), lens, SIZE).layout
    points = len(layout.places)
    if points > 2000:
        assert len(layout.slots) - points < 0.05 * points
