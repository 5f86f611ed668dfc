"""Scores of a look network, and the calibration of its probability."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_train.look.judging import Found, shown_before
from vm_train.look.labels import NOTHING, OBJECT
from vm_train.look.patch_set import PatchSet
from vm_train.look.scores import LookResult, LookScore, average_precision
from vm_train.scores.calibration import BINS, Calibration, Reliability

flags = st.lists(st.booleans(), min_size=1, max_size=40)


def answers(count, seed=0, scale=1.0, offset=0.0):
    """Logits, and flags that are right with the probability of scale * logit + offset."""
    random = np.random.default_rng(seed)
    logits = random.normal(0.0, 3.0, count)
    return logits, random.random(count) < 1.0 / (1.0 + np.exp(-(scale * logits + offset)))


@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (0.5, -2.0), (2.0, 1.0)])
def test_the_calibration_of_many_answers_is_found(scale, offset):
    found = Calibration.fit(*answers(100_000, 1, scale, offset))
    assert (found.scale, found.offset) == pytest.approx((scale, offset), abs=0.05)


def test_calibrated_probabilities_are_right_as_often_as_they_say():
    logits, right = answers(100_000, 2, 0.4, -1.0)
    before = Reliability.of(Calibration().probabilities(logits), right).error
    after = Reliability.of(Calibration.fit(logits, right).probabilities(logits), right).error
    assert after < 0.01 < 0.1 < before


@given(flags, st.integers(0, 2**32))
def test_a_calibration_is_finite_and_keeps_the_order_whatever_it_is_fitted_to(right, seed):
    logits = np.random.default_rng(seed).normal(0.0, 30.0, len(right))
    found = Calibration.fit(logits, np.array(right))
    assert found.scale > 0.0
    assert math.isfinite(found.scale + found.offset)
    probabilities = found.probabilities(np.sort(logits))
    assert ((probabilities >= 0.0) & (probabilities <= 1.0)).all()
    assert (np.diff(probabilities) >= 0.0).all()


def test_answers_without_a_mistake_do_not_get_an_infinite_scale():
    found = Calibration.fit(np.array([-2.0, -1.0, 1.0, 2.0]), np.array([False, False, True, True]))
    assert 0.5 < found.scale < 5.0


@given(flags, st.integers(0, 2**32))
def test_the_average_precision_is_that_of_a_ranking(right, seed):
    right = np.array(right)
    confidence = np.random.default_rng(seed).permutation(len(right)).astype(float)
    ranked = right[np.argsort(-confidence)]
    precision = np.cumsum(ranked) / np.arange(1, len(right) + 1)
    highest = np.maximum.accumulate(precision[::-1])[::-1]
    expected = highest[ranked].mean() if right.any() else math.nan
    assert average_precision(confidence, right) == pytest.approx(expected, nan_ok=True)
    if right.any():
        assert average_precision(confidence, right, 2 * int(right.sum())) == pytest.approx(expected / 2)


def test_equal_answers_count_together():
    assert average_precision(np.zeros(4), np.array([True, False, False, False])) == 0.25


def test_errors_are_medians_over_patches_with_an_object():
    patches = PatchSet.empty(16, 4)
    patches.labels[:] = [OBJECT, OBJECT, OBJECT, NOTHING]
    patches.targets[:3, 0] = 0.1
    logits = np.zeros((4, 4), dtype=np.float32)
    logits[:, 0] = [3.0, 2.0, 1.0, 0.0]
    logits[:, 1] = [0.1, 0.4, 0.3, 9.0]
    logits[:, 3] = [0.1, -0.1, 0.1, 9.0]
    found = LookScore.of(logits, patches)
    assert (found.average_precision, found.center_error, found.size_error) == pytest.approx((1.0, 0.2, 0.1))


def test_the_result_counts_what_is_reported_and_what_is_missed():
    found = Found(np.array([4.0, 3.0, 2.0, -4.0]), np.array([True, False, True, False]), objects=4, pictures=3)
    made = LookResult.of(found, Calibration())
    assert (made.hits, made.false, made.average_precision) == pytest.approx((2, 1, (1.0 + 2 / 3) / 4))
    assert "finds 2 of 4 visible objects" in str(made)
    assert len(made.as_dict()["bins"]) == BINS
    empty = {"from": 0.4667, "to": 0.5333, "count": 0, "confidence": None, "right": None}
    assert made.as_dict()["bins"][7] == empty
    nothing = LookResult.of(Found.joined([]), Calibration())
    assert nothing.as_dict()["average_precision"] is None


@given(st.lists(st.integers(-1, 4), max_size=12))
def test_of_several_places_of_an_object_only_the_first_counts(objects):
    counted = np.array(objects, dtype=np.int64)[~shown_before(np.array(objects, dtype=np.int64))].tolist()
    assert [each for each in counted if each >= 0] == list(dict.fromkeys(each for each in objects if each >= 0))
    assert counted.count(-1) == objects.count(-1)
