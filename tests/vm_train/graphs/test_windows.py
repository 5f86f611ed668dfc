"""Windows: parts of a picture's graph."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_train.graphs.labeled_graph import LabeledGraph
from vm_train.graphs.loading import empty_graph
from vm_train.graphs.windows import random_window

SIZE = np.array([120.0, 80.0])


def graph(n=400, seed=0):
    random = np.random.default_rng(seed)
    neighbors = np.concatenate([random.integers(0, n + 1, (n, 6)), np.full((1, 6), n)]).astype(np.int32)
    points = random.random((n + 1, 3), dtype=np.float32)
    points[-1] = -1.0
    labels = (np.arange(n) != 7).astype(np.int8)
    return LabeledGraph(points, neighbors, labels, random.random(n), random.random((n, 2)) * SIZE)


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
    whole, nothing, random = graph(), empty_graph(6), np.random.default_rng(0)
    assert random_window(whole, 1.0, [0], random) is whole
    assert random_window(nothing, 0.5, [0], random) is nothing
