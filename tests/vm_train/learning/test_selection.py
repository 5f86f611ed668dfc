"""Which points give gradients."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_train.learning.selection import (
    FLOOR,
    class_totals,
    class_weights,
    hardness_weights,
    point_errors,
    select_points,
    selection_shares,
)

counts = st.lists(st.integers(0, 10**9), min_size=2, max_size=8).map(np.array)
labelings = st.lists(st.integers(-1, 3), min_size=1, max_size=200).map(lambda each: np.array(each, dtype=np.int8))


@given(counts)
def test_balanced_shares_give_every_class_as_many_points_as_the_rarest_has(counts):
    none = np.zeros(len(counts), dtype=bool)
    shares = selection_shares("balanced", counts, none)
    assert ((shares >= 0.0) & (shares <= 1.0)).all()
    if counts.any():
        assert (shares * counts)[counts > 0] == pytest.approx(counts[counts > 0].min())
    assert (selection_shares("all", counts, none) == 1.0).all()
    assert (selection_shares("hard", counts, none) == shares).all()


@given(counts, st.integers(0, 7))
def test_classes_that_are_rarer_than_every_object_are_taken_whole(counts, position):
    objects = np.arange(len(counts)) == position % len(counts)
    shares = selection_shares("balanced", counts, objects)
    if counts[objects].any():
        assert shares * counts == pytest.approx(np.minimum(counts, counts[objects][0]))


@given(labelings, st.integers(0, 99))
def test_all_that_is_labeled_can_be_selected_and_nothing_else(labels, seed):
    draws = np.random.default_rng(seed).random(len(labels))
    assert (select_points(labels, np.ones(4), draws) == (labels >= 0)).all()
    assert not select_points(labels, np.zeros(4), draws).any()


def test_a_class_is_selected_by_its_share():
    labels = np.repeat(np.array([0, 1, -1], dtype=np.int8), 20000)
    chosen = select_points(labels, np.array([0.3, 0.02]), np.random.default_rng(2).random(len(labels)))
    assert np.bincount(labels[chosen], minlength=2) / 20000 == pytest.approx([0.3, 0.02], abs=0.01)


def test_hard_points_are_selected_by_their_error_and_the_floor_and_as_many_as_without():
    labels = np.zeros(10000, dtype=np.int8)
    errors = np.zeros(len(labels), dtype=np.float32)
    errors[:1000] = 1.0
    weights = hardness_weights(errors)
    sums, numbers = class_totals(labels, weights, 1)
    draws = np.random.default_rng(1).random((50, len(labels)))
    chosen = np.array([select_points(labels, np.array([0.05]), each, weights / (sums / numbers)) for each in draws])
    expected = 1000 * (1.0 + FLOOR) / (1000 * (1.0 + FLOOR) + 9000 * FLOOR)
    assert chosen[:, :1000].sum() / chosen.sum() == pytest.approx(expected, abs=0.02)
    assert chosen.mean() == pytest.approx(0.05, rel=0.02)


def test_errors_of_several_networks_add_up_to_at_most_a_whole():
    assert hardness_weights(np.array([0.0, 0.4, 1.7], dtype=np.float32)) == pytest.approx(
        [FLOOR, 0.4 + FLOOR, 1.0 + FLOOR]
    )


@given(labelings)
def test_totals_of_parts_add_up(labels):
    weights = np.linspace(0.1, 1.0, len(labels))
    half = len(labels) // 2
    parts = class_totals(labels[:half], weights[:half], 4) + class_totals(labels[half:], weights[half:], 4)
    assert parts == pytest.approx(class_totals(labels, weights, 4))


def test_errors_are_one_minus_the_probability_of_the_truth():
    probabilities = np.array([[0.9, 0.1], [0.3, 0.7], [0.5, 0.5]], dtype=np.float32)
    assert point_errors(probabilities, np.array([0, 0, -1], dtype=np.int8)) == pytest.approx([0.1, 0.7, 0.0])


@given(counts.filter(np.any), st.floats(0.0, 1.0))
def test_weights_balance_classes_and_are_one_in_the_mean(counts, balance):
    weights = class_weights("weighted", counts, balance)
    assert (class_weights("balanced", counts, balance) == 1.0).all()
    assert weights @ counts == pytest.approx(counts.sum())
    occurring = counts > 0
    totals = (weights * counts)[occurring] * counts[occurring].astype(float) ** (balance - 1.0)
    assert totals == pytest.approx(np.full(occurring.sum(), totals[0]))
