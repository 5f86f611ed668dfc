"""What a network is to answer: labels, soft at outlines, and a teacher's answers."""

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from vm_train.learning.loss import soft_targets


@st.composite
def graphs(draw):
    """Labels (n,) of three classes or none, and neighbors (n + 1, 6)."""
    n = draw(st.integers(1, 30))
    labels = draw(arrays.arrays(np.int64, n, elements=st.integers(-1, 2)))
    neighbors = draw(arrays.arrays(np.int32, (n + 1, 6), elements=st.integers(0, n)))
    neighbors[-1] = n
    return torch.from_numpy(labels), torch.from_numpy(neighbors)


@given(graphs(), st.floats(0.0, 1.0))
def test_they_are_probabilities_that_a_loop_over_points_agrees_with(graph, smoothing):
    labels, neighbors = graph
    found = soft_targets(labels, 3, neighbors, smoothing)
    for point, label in enumerate(labels.tolist()):
        if label < 0:
            continue
        around = [int(labels[each]) for each in neighbors[point] if each < len(labels) and labels[each] >= 0]
        expected = np.zeros(3)
        expected[label] += 1.0 - smoothing if around else 1.0
        for each in around:
            expected[each] += smoothing / len(around)
        np.testing.assert_allclose(found[point].numpy(), expected, atol=1e-6)


@given(graphs())
def test_without_smoothing_and_teacher_they_are_the_labels(graph):
    labels, neighbors = graph
    found = soft_targets(labels, 3, neighbors, 0.0)
    assert (found.argmax(dim=1)[labels >= 0] == labels[labels >= 0]).all()
    assert (found.max(dim=1).values[labels >= 0] == 1.0).all()


def test_inside_an_object_labels_stay_hard():
    row = torch.tensor([0, 0, 0, 0, 1, 1, 1, 1])
    places = np.arange(8)[:, None] + (-1, 1)
    neighbors = torch.from_numpy(np.append(np.where((places >= 0) & (places < 8), places, 8), [[8, 8]], axis=0))
    found = soft_targets(row, 2, neighbors, 0.5)
    assert found[:, 0].tolist() == [1.0, 1.0, 1.0, 0.75, 0.25, 0.0, 0.0, 0.0]


@given(graphs(), st.floats(0.0, 1.0))
def test_a_teacher_has_its_share(graph, share):
    labels, neighbors = graph
    taught = torch.full((len(labels), 3), 1.0 / 3.0)
    alone, with_it = soft_targets(labels, 3, neighbors, 0.0), soft_targets(labels, 3, neighbors, 0.0, taught, share)
    assert torch.allclose(with_it, (1.0 - share) * alone + share * taught, atol=1e-6)
