import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.detection.projection import project
from vm_embedded.errors import InputError
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid, Rectilinear
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.models import build_mesh
from vm_export.network import Network
from vm_export.network_shape import NetworkShape
from vm_train.graphs.hexagonal import hexagonal_mesh, visible_hexagonal_mesh

SIZE = (640, 480)
WIDE = Equisolid(focal_length=210.0, fov=2.0, size=SIZE)
"""Draws a circle that leaves the picture's corners black."""

sizes = st.tuples(st.integers(160, 2000), st.integers(160, 2000)).filter(lambda size: 0.4 < size[0] / size[1] < 2.5)
meshes = st.builds(hexagonal_mesh, sizes, st.integers(1, 3000))

DIRECTIONS = np.stack([np.cos(np.arange(6) * math.pi / 3.0), -np.sin(np.arange(6) * math.pi / 3.0)], axis=1)
"""Of the six columns in the picture (x right, y down): right, then counterclockwise."""


@given(sizes, st.integers(1200, 60000))
def test_a_mesh_has_the_wanted_number_of_points_within_a_hundredth(size, count):
    assert len(hexagonal_mesh(size, count)) == pytest.approx(count, rel=0.01)


@given(meshes)
def test_every_neighbor_is_one_spacing_away_in_its_column_s_direction(mesh):
    at = np.append(mesh.pixels, [[np.nan, np.nan]], axis=0)
    steps = (at[mesh.neighbors[:-1]] - mesh.pixels[:, None]) / mesh.spacing
    linked = mesh.neighbors[:-1] < len(mesh)
    np.testing.assert_allclose(steps[linked], np.broadcast_to(DIRECTIONS, steps.shape)[linked], atol=1e-6)


@given(sizes, st.integers(1, 3000))
def test_a_neighbor_is_missing_only_where_the_picture_has_no_room_for_it(size, count):
    mesh = hexagonal_mesh(size, count)
    missing = mesh.neighbors[:-1] == len(mesh)
    places = mesh.pixels[:, None] + mesh.spacing * DIRECTIONS
    inside = ((places >= 0.0) & (places < np.array(size) - 1.0)).all(axis=2)
    # A place on the very border, or with a margin that both borders share, may be left out.
    deep = ((places > 1e-6 * mesh.spacing) & (places < np.array(size) - 1.0 - 1e-6 * mesh.spacing)).all(axis=2)
    assert not (missing & deep).any()
    assert not (~missing & ~inside).any()


@given(meshes)
def test_neighbors_are_neighbors_of_each_other_in_opposite_columns(mesh):
    for column in range(6):
        points = np.flatnonzero(mesh.neighbors[:-1, column] < len(mesh))
        back = mesh.neighbors[mesh.neighbors[points, column], (column + 3) % 6]
        np.testing.assert_array_equal(back, points)


@given(meshes)
def test_the_off_screen_point_is_linked_to_itself_alone(mesh):
    assert mesh.neighbors.shape == (len(mesh) + 1, 6)
    assert (mesh.neighbors[-1] == len(mesh)).all()


@given(sizes, st.integers(50, 3000), st.integers(0, 2**32 - 1))
def test_no_place_of_the_picture_is_further_than_a_spacing_from_a_point(size, count, seed):
    mesh = hexagonal_mesh(size, count)
    assert (mesh.pixels >= 0.0).all()
    assert (mesh.pixels + 1.0 < np.array(size)).all()
    far = np.array(size) - 1.0
    places = np.concatenate([np.random.default_rng(seed).random((30, 2)), [[0, 0], [0, 1], [1, 0], [1, 1]]]) * far
    nearest = np.linalg.norm(places[:, None] - mesh.pixels, axis=2).min(axis=1)
    assert nearest.max() <= 1.33 * mesh.spacing  # corners, of which alternate rows stay half a spacing away


def test_columns_lie_in_the_picture_where_ring6_has_them():
    orientation = Orientation.from_roll_pitch(0.9, pitch=0.6)
    lens = Rectilinear(focal_length=400.0, fov=2.0, size=SIZE)
    shown = project(build_mesh(Sphere(0.075), 0.9, 4, 20.0), orientation.level, lens, SIZE).visible
    ahead = np.flatnonzero(np.linalg.norm(shown.pixels - [320.0, 240.0], axis=1) < 60.0)
    steps = shown.pixels[shown.graph.neighbors[ahead]] - shown.pixels[ahead, None]
    mean = steps.mean(axis=0)
    turns = mean / np.linalg.norm(mean, axis=1, keepdims=True) @ DIRECTIONS.T
    np.testing.assert_array_equal(turns.argmax(axis=1), np.arange(6))


@given(meshes, st.integers(0, 2**32 - 1))
def test_links_of_a_part_to_all_others_lead_to_its_off_screen_point(mesh, seed):
    kept = np.flatnonzero(np.random.default_rng(seed).random(len(mesh)) < 0.7)
    part = mesh.part(kept)
    np.testing.assert_array_equal(part.pixels, mesh.pixels[kept])
    whole = np.append(kept, len(mesh))[part.neighbors[:-1]]
    expected = np.where(np.isin(mesh.neighbors[kept], kept), mesh.neighbors[kept], len(mesh))
    np.testing.assert_array_equal(whole, expected)
    assert (part.neighbors[-1] == len(part)).all()


@given(st.integers(1000, 20000))
def test_of_a_fisheye_s_circle_all_points_are_seen_and_as_many_as_wanted(count):
    mesh = visible_hexagonal_mesh(WIDE, SIZE, count)
    assert mesh.on_screen(WIDE, SIZE).all()
    assert len(mesh) == pytest.approx(count, rel=0.01)
    assert len(mesh) < 0.9 * len(hexagonal_mesh(SIZE, round(640 * 480 / (mesh.spacing**2 * math.sqrt(0.75)))))


def test_a_lens_that_sees_the_whole_picture_sees_the_whole_mesh():
    lens = Rectilinear(focal_length=400.0, fov=2.5, size=SIZE)
    whole, seen = hexagonal_mesh(SIZE, 5000), visible_hexagonal_mesh(lens, SIZE, 5000)
    np.testing.assert_array_equal(seen.pixels, whole.pixels)
    np.testing.assert_array_equal(seen.neighbors, whole.neighbors)


def test_the_networks_of_the_visual_mesh_take_it():
    mesh = hexagonal_mesh(SIZE, 500)
    network = Network(NetworkShape.uniform(3, 4, 2))
    points = torch.cat([torch.rand(len(mesh), 3), torch.full((1, 3), -1.0)])
    with torch.no_grad():
        probabilities = network(points, torch.from_numpy(mesh.neighbors.copy()))
    assert probabilities.shape == (len(mesh) + 1, 2)
    assert torch.isfinite(probabilities).all()


def test_no_points_no_picture_and_a_blind_lens_are_refused():
    with pytest.raises(InputError, match="mesh of 0 points does not fit"):
        hexagonal_mesh(SIZE, 0)
    with pytest.raises(InputError, match="1 x 480"):
        hexagonal_mesh((1, 480), 100)
    with pytest.raises(InputError, match="sees no part of"):
        visible_hexagonal_mesh(Rectilinear(focal_length=400.0, fov=0.1, center=(2000.0, 0.0)), SIZE, 100)
