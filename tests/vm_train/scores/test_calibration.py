"""Reliability and its error against their definitions."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_train.scores.calibration import BINS, Reliability

answers = st.lists(st.tuples(st.floats(0.0, 1.0), st.booleans()), max_size=60)


def of(found):
    confidence = np.array([each for each, _ in found], dtype=np.float64)
    return Reliability.of(confidence, np.array([right for _, right in found], dtype=bool))


@given(answers)
def test_bins_and_error_are_their_definitions(found):
    bins = [[] for _ in range(BINS)]
    for confidence, right in found:
        bins[min(int(confidence * BINS), BINS - 1)].append((confidence, right))
    made = of(found)
    assert made.counts == tuple(map(len, bins))
    gaps = []
    for each, confidence, share in zip(bins, made.confidences, made.right, strict=True):
        if each:
            columns = np.array(each, dtype=np.float64).mean(axis=0)
            assert (confidence, share) == pytest.approx(tuple(columns))
            gaps += [abs(columns[0] - columns[1])] * len(each)
        else:
            assert math.isnan(confidence)
            assert math.isnan(share)
    assert made.error == pytest.approx(np.mean(gaps) if gaps else math.nan, nan_ok=True)


@given(answers, st.randoms(use_true_random=False))
def test_the_order_of_answers_does_not_matter(found, random):
    shuffled = random.sample(found, len(found))
    assert of(shuffled).as_dict() == of(found).as_dict()


@given(st.lists(st.integers(1, 40).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))), min_size=1, max_size=9))
def test_groups_whose_share_is_their_confidence_have_no_error(groups):
    found = [(hits / count, number < hits) for hits, count in groups for number in range(count)]
    assert of(found).error == pytest.approx(0.0, abs=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_a_perfect_calibration_has_an_error_near_0(seed):
    random = np.random.default_rng(seed)
    confidence = random.random(20000)
    made = Reliability.of(confidence, random.random(20000) < confidence)
    assert made.error < 0.03  # about 0.009 by chance
    low, high = made.intervals()
    inside = (low <= made.confidences) & (made.confidences <= high)
    assert inside.sum() >= 8  # 13.5 of 15 on average


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_error_of_one_answer_is_its_distance_from_the_truth(confidence, other):
    assert of([(confidence, True)]).error == pytest.approx(1.0 - confidence)
    assert of([(other, False)]).error == pytest.approx(other)


@given(answers)
def test_intervals_hold_their_shares_and_stay_between_0_and_1(found):
    made = of(found)
    for count, share, low, high in zip(made.counts, made.right, *made.intervals(), strict=True):
        if count:
            assert -1e-9 <= low <= share + 1e-9
            assert share - 1e-9 <= high <= 1.0 + 1e-9
        else:
            assert math.isnan(low)
            assert math.isnan(high)


@given(st.integers(1, 500).flatmap(lambda count: st.tuples(st.integers(0, count), st.just(count))))
def test_from_a_limit_the_share_is_1_645_standard_deviations_away(numbers):
    hits, count = numbers
    low, high = of([(0.5, number < hits) for number in range(count)]).intervals()
    for limit in (low[7], high[7]):
        deviation = math.sqrt(max(limit * (1.0 - limit), 0.0) / count)
        assert abs(hits / count - limit) == pytest.approx(1.645 * deviation, abs=1e-6)


def test_rows_have_no_nan_and_cover_0_to_1():
    made = of([(1.0, True), (0.0, False)])
    assert json.loads(json.dumps(made.as_dict(), allow_nan=False)) == made.as_dict()
    rows = made.rows()
    assert (rows[0]["from"], rows[-1]["to"], len(rows)) == (0.0, 1.0, BINS)
    assert [each["count"] for each in rows] == [1, *[0] * 13, 1]
    assert rows[7]["confidence"] is None
    assert of([]).as_dict()["expected_error"] is None
