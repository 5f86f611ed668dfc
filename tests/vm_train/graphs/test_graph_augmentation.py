"""Windows and mirror images of labeled graphs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.manifests import ball_manifest
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Rectilinear
from vm_embedded.mesh.models import MESH_MODELS
from vm_train.data.pictures import Picture
from vm_train.graphs.graph_recipe import mirror_image, mirrored_columns, random_window
from vm_train.graphs.labeled_graph import LabeledGraph, empty_graph, graph_of

WINDOWED = np.array([120.0, 80.0])


def graph(n=400, seed=0):
    random = np.random.default_rng(seed)
    neighbors = np.concatenate([random.integers(0, n + 1, (n, 6)), np.full((1, 6), n)]).astype(np.int32)
    points = random.random((n + 1, 3), dtype=np.float32)
    points[-1] = -1.0
    labels = (np.arange(n) != 7).astype(np.int8)
    return LabeledGraph(points, neighbors, labels, random.random(n), random.random((n, 2)) * WINDOWED)


@given(st.floats(0.05, 0.99), st.integers(0, 2**32))
def test_a_window_is_the_subgraph_of_its_points(share, seed):
    whole = graph()
    part = random_window(whole, share, [0], np.random.default_rng(seed))
    kept = np.flatnonzero((whole.pixels[:, None] == part.pixels).all(axis=2).any(axis=1))
    assert len(kept) == len(part)
    if len(part):
        assert (np.ptp(part.pixels, axis=0) <= share * np.ptp(whole.pixels, axis=0) + 1e-9).all()
    assert np.array_equal(part.points, whole.points[[*kept, len(whole)]])
    assert np.array_equal(part.labels, whole.labels[kept])
    assert np.array_equal(part.distances, whole.distances[kept])
    names = np.append(kept, len(whole))
    for row, place in enumerate(kept):
        for ours, theirs in zip(part.neighbors[row], whole.neighbors[place], strict=True):
            assert names[ours] == (theirs if theirs in kept else len(whole))
    assert (part.neighbors[-1] == len(part)).all()


def test_most_windows_are_put_over_an_object():
    random = np.random.default_rng(3)
    share = np.mean([(random_window(graph(), 0.2, [0], random).labels == 0).any() for _ in range(600)])
    assert share == pytest.approx(0.76, abs=0.06)


def test_without_objects_windows_are_anywhere():
    whole, random = graph(), np.random.default_rng(3)
    seen = {tuple(pixel) for _ in range(300) for pixel in random_window(whole, 0.3, [], random).pixels.tolist()}
    assert len(seen) > 0.95 * len(whole)


def test_what_is_whole_or_empty_stays_as_it_is():
    whole, nothing, random = graph(), empty_graph(ball_manifest()), np.random.default_rng(0)
    assert random_window(whole, 1.0, [0], random) is whole
    assert random_window(nothing, 0.5, [0], random) is nothing


SIZE = (161, 121)


def manifest(model):
    entries = {"intersections": 3.0, "mesh": model, "max_distance": 6.0}
    if model == "wall6":
        return ball_manifest("ball:upright", "other", shape="cylinder", object_height=1.0, **entries)
    return ball_manifest("ball", "other", **entries)


def pictures():
    """A picture of noise, and the same in a mirror, both seen by a level camera that looks straight ahead."""
    random = np.random.default_rng(3)
    image = random.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    labels = random.integers(0, 2, (SIZE[1], SIZE[0]), dtype=np.int8)
    lens = LensFile(
        Rectilinear(focal_length=110.0, fov=2.8, center=(0.5, 0.0)), Orientation.from_roll_pitch(1.0, 0.0, 0.5)
    )
    return [Picture(image[:, ::turn], labels[:, ::turn], lens) for turn in (1, -1)]


GRAPHS = sorted(set(MESH_MODELS) - {"octaves"})
"""Meshes whose networks take neighbors."""


@pytest.mark.parametrize("model", GRAPHS)
def test_places_of_a_mirror_image_in_a_mirror_are_where_they_were(model):
    places = mirrored_columns(MESH_MODELS[model])
    assert sorted(places.tolist()) == list(range(MESH_MODELS[model].neighbors))
    assert places[places].tolist() == list(range(len(places)))


@pytest.mark.parametrize("model", GRAPHS)
def test_a_mirror_image_is_what_a_network_sees_of_a_picture_that_is_mirrored(model):
    """Each point has a twin of the same color on the other side, and nearly all have their twins' neighbors: of a point
    that lies exactly between two of the next ring, one is always on the same side."""
    plain, true = (graph_of(each, manifest(model)) for each in pictures())
    seen = mirror_image(plain, MESH_MODELS[model])
    turned = np.stack([SIZE[0] - 1.0 - seen.pixels[:, 0], seen.pixels[:, 1]], axis=1)
    apart = np.hypot(*(turned[:, None] - true.pixels[None]).transpose(2, 0, 1))
    twin = np.append(apart.argmin(axis=1), len(true))
    assert len(seen) == len(true) > 100
    assert apart.min(axis=1).max() < 1e-6
    assert np.allclose(seen.points, true.points[twin], atol=1e-6)
    assert np.array_equal(seen.labels, true.labels[twin[:-1]])
    expected = true.neighbors[twin]
    shown = expected < len(true)
    assert (twin[seen.neighbors] == expected)[shown].mean() > 0.9
    stay = np.mean(mirrored_columns(MESH_MODELS[model]) == np.arange(MESH_MODELS[model].neighbors))
    assert (twin[plain.neighbors] == expected)[shown].mean() < stay + 0.1
