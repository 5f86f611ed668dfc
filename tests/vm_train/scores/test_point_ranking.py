"""Rankings of points against the definitions of their scores, and against brute force."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vm_train.scores.point_ranking import BINS, PROBABILITY_EDGES, PointOutcome
from vm_train.scores.point_scores import PointScores

CLASSES = ("ball", "line", "field")


EDGES = np.array([0.0, 1.0, 2.0, 5.0])


def points_of(seed, count, levels, spread):
    """Points by seed: probabilities (n, 3), of few levels or of many, labels (n,) from -1, distances (n,)."""
    random = np.random.default_rng(seed)
    probabilities = random.beta(spread, spread, (count, 3))
    if levels:
        probabilities = np.rint(probabilities * levels) / levels
    distances = random.choice([-1.0, 0.0, 0.5, 1.0, 1.7, 2.0, 4.9, 5.0, 99.0, np.inf, np.nan], count)
    return probabilities.astype(np.float32), random.integers(-1, 3, count).astype(np.int8), distances


points = st.builds(
    points_of,
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(0, 60),
    levels=st.sampled_from([0, 1, 4, 100]),
    spread=st.sampled_from([0.02, 0.3, 1.0]),
)


def scored(probabilities, labels, distances):
    scores = PointScores(CLASSES, EDGES)
    scores.add(probabilities, labels, distances)
    return scores


def ball(probabilities, labels):
    """Probabilities of the first class at labeled points (n,), as float64, and whether they are of it (n,)."""
    return probabilities[labels >= 0, 0].astype(np.float64), labels[labels >= 0] == 0


def in_bins(p):
    """Probabilities (n,), each lowered to the edge of its bin."""
    return PROBABILITY_EDGES[[max(k for k in range(BINS) if PROBABILITY_EDGES[k] <= each) for each in p]]


def average_precision(p, own):
    """Each point of the class adds the best precision of all thresholds that reach it or more of its class."""
    found = [(int((own & (p >= t)).sum()), (own & (p >= t)).sum() / (p >= t).sum()) for t in set(p.tolist())]
    number = int(own.sum())
    if number == 0:
        return math.nan
    return sum(max(precision for hits, precision in found if hits >= k) for k in range(1, number + 1)) / number


def roc_area(p, own):
    """Share of all pairs whose point of the class is above, where equal ones are half above."""
    pairs = [(a > b) + 0.5 * (a == b) for a in p[own] for b in p[~own]]
    return float(np.mean(pairs)) if pairs else math.nan


def outcome(p, own, threshold):
    taken = p >= threshold
    return PointOutcome(*(int(each.sum()) for each in (taken & own, taken & ~own, ~taken & own, ~taken & ~own)))


def test_edges_of_bins_reach_from_0_to_1_over_one_half_and_no_bin_is_wide():
    assert [PROBABILITY_EDGES[k] for k in (0, BINS // 2, BINS)] == [0.0, 0.5, 1.0]
    widths = np.diff(PROBABILITY_EDGES)
    assert widths.min() > 0.0
    assert widths.max() < 8e-4
    assert max(widths[0], widths[-1]) < 6e-7


@given(points)
def test_average_precision_is_its_definition_with_probabilities_lowered_to_their_bin(given_points):
    p, own = ball(*given_points[:2])
    measured = scored(*given_points).ranking("ball").precision_recall.average_precision
    assert measured == pytest.approx(average_precision(in_bins(p), own), nan_ok=True)


@given(points)
def test_bins_lower_average_precision_by_no_more_than_the_order_inside_of_them_could_raise_it(given_points):
    p, own = ball(*given_points[:2])
    measured = scored(*given_points).ranking("ball").precision_recall.average_precision
    assume(not math.isnan(measured))
    best = average_precision(in_bins(p) + 1e-12 * own, own)
    assert measured - 1e-9 <= average_precision(p, own) <= best + 1e-9


@given(points)
def test_roc_area_is_the_share_of_pairs_in_right_order_but_for_pairs_inside_one_bin(given_points):
    p, own = ball(*given_points[:2])
    measured = scored(*given_points).ranking("ball").roc.area
    lowered = in_bins(p)
    assert measured == pytest.approx(roc_area(lowered, own), nan_ok=True)
    if not math.isnan(measured):
        together = np.mean(lowered[own][:, None] == lowered[~own])
        assert abs(measured - roc_area(p, own)) <= together / 2.0 + 1e-9


@given(points, st.integers(0, BINS - 1))
def test_outcomes_at_edges_are_exact(given_points, number):
    p, own = ball(*given_points[:2])
    threshold = float(PROBABILITY_EDGES[number])
    assert scored(*given_points).ranking("ball").at(threshold) == outcome(p, own, threshold)


@given(points, st.floats(0.0, 1.0))
def test_outcomes_elsewhere_are_those_of_a_threshold_half_a_bin_away(given_points, threshold):
    p, own = ball(*given_points[:2])
    measured = scored(*given_points).ranking("ball").at(threshold)
    half = np.diff(PROBABILITY_EDGES).max() / 2.0 + 1e-12
    more = outcome(p, own, min(threshold - half, PROBABILITY_EDGES[-2]))
    fewer = outcome(p, own, threshold + half)
    assert fewer.hits <= measured.hits <= more.hits
    assert fewer.false <= measured.false <= more.false


@given(points)
def test_curves_pass_through_the_outcomes_at_their_thresholds(given_points):
    ranking = scored(*given_points).ranking("line")
    curve, roc = ranking.precision_recall, ranking.roc
    outcomes = [ranking.at(threshold) for threshold in curve.thresholds]
    assert curve.precision == pytest.approx([each.precision for each in outcomes])
    assert curve.recall == pytest.approx([each.recall for each in outcomes], nan_ok=True)
    assert roc.true_positive_rate[1:] == pytest.approx([each.recall for each in outcomes], nan_ok=True)
    assert roc.thresholds[1:] == pytest.approx(curve.thresholds)
    assert (np.diff(curve.thresholds) < 0.0).all()


counts = st.integers(0, 20)


outcomes = st.builds(PointOutcome, counts, counts, counts, counts)


@given(outcomes)
def test_f1_is_the_harmonic_mean_of_precision_and_recall(each):
    if each.hits:
        assert each.f1 == pytest.approx(2.0 / (1.0 / each.precision + 1.0 / each.recall))


@given(outcomes)
def test_mcc_is_the_correlation_of_truth_and_answer(each):
    kinds = [(1, 1)] * each.hits + [(0, 1)] * each.false + [(1, 0)] * each.missed + [(0, 0)] * each.rejected
    truth, answer = np.array(kinds, dtype=float).reshape(-1, 2).T
    if len(set(truth)) < 2 or len(set(answer)) < 2:
        assert math.isnan(each.mcc)
    else:
        assert each.mcc == pytest.approx(np.corrcoef(truth, answer)[0, 1])


@given(outcomes)
def test_informedness_times_markedness_is_the_square_of_mcc(each):
    assert each.informedness * each.markedness == pytest.approx(each.mcc**2, nan_ok=True)


@given(outcomes)
def test_informedness_is_markedness_with_truth_and_answer_exchanged(each):
    exchanged = PointOutcome(each.hits, each.missed, each.false, each.rejected)
    if not math.isnan(each.mcc):
        assert each.informedness == pytest.approx(exchanged.markedness)
