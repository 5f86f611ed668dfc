"""Which points give gradients."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_train.selection import FLOOR, errors_of, selected

labelings = st.lists(st.integers(-1, 3), min_size=1, max_size=200).map(lambda each: np.array(each, dtype=np.int8))


@given(labelings, st.integers(0, 99))
def test_balanced_selects_as_many_of_each_class_as_of_the_rarest(labels, seed):
    chosen = selected("balanced", labels, 4, None, np.random.default_rng(seed))
    present = [number for number in range(4) if (labels == number).any()]
    rarest = min((np.count_nonzero(labels == number) for number in present), default=0)
    assert not chosen[labels < 0].any()
    assert [np.count_nonzero(chosen & (labels == number)) for number in present] == [rarest] * len(present)


@given(labelings)
def test_all_selects_all_that_is_labeled(labels):
    assert (selected("all", labels, 4, None, np.random.default_rng(0)) == (labels >= 0)).all()


def test_hard_selects_points_in_proportion_to_their_error_and_the_floor():
    labels = np.array([0] * 10 + [1] * 1000, dtype=np.int8)
    errors = np.zeros(len(labels), dtype=np.float32)
    errors[10:110] = 1.0
    random = np.random.default_rng(1)
    hits = sum(int(selected("hard", labels, 2, errors, random)[10:110].sum()) for _ in range(400))
    expected = 100 * (1.0 + FLOOR) / (100 * (1.0 + FLOOR) + 900 * FLOOR)
    assert hits / 4000 == pytest.approx(expected, abs=0.05)


def test_errors_are_one_minus_the_probability_of_the_truth():
    probabilities = np.array([[0.9, 0.1], [0.3, 0.7], [0.5, 0.5]], dtype=np.float32)
    assert errors_of(probabilities, np.array([0, 0, -1], dtype=np.int8)) == pytest.approx([0.1, 0.7, 0.0])


def test_hard_without_errors_and_unknown_rules_are_refused():
    labels = np.array([0, 1], dtype=np.int8)
    with pytest.raises(InputError, match="trained before"):
        selected("hard", labels, 2, None, np.random.default_rng(0))
    with pytest.raises(InputError, match="did you mean 'balanced'"):
        selected("balance", labels, 2, None, np.random.default_rng(0))
