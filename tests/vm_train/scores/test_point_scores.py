"""Scores of points against their definitions, spelled out point by point."""

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vm_embedded.errors import InputError, ModelError
from vm_train.scores.distance_bins import bins_of
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


@given(points)
def test_the_confusion_matrix_counts_true_and_most_probable_classes(given_points):
    probabilities, labels, _ = given_points
    expected = np.zeros((3, 3), dtype=int)
    for p, label in zip(probabilities.tolist(), labels, strict=True):
        if label >= 0:
            expected[label, p.index(max(p))] += 1
    assert (scored(*given_points).confusion() == expected).all()


@given(points, points)
def test_adding_scores_is_scoring_all_points_at_once(some, others):
    both = scored(*some) + scored(*others)
    at_once = scored(*(np.concatenate(each) for each in zip(some, others, strict=True)))
    one_by_one = scored(*some)
    one_by_one.add(*others)
    for scores in (at_once, one_by_one):
        for place in (None, 0, 1, 2):
            assert (both.confusion(place) == scores.confusion(place)).all()
            for name in CLASSES:
                assert both.ranking(name, place).as_dict() == scores.ranking(name, place).as_dict()
                assert (both.ranking(name, place).own == scores.ranking(name, place).own).all()
                assert (both.ranking(name, place).others == scores.ranking(name, place).others).all()


@given(points)
def test_a_distance_bin_scores_the_points_between_its_edges_alone(given_points):
    probabilities, labels, distances = given_points
    for place, (low, high) in enumerate(pairwise(EDGES)):
        here = (distances >= low) & (distances < high)
        alone = scored(probabilities[here], labels[here], distances[here])
        everywhere = scored(*given_points)
        assert (alone.confusion() == everywhere.confusion(place)).all()
        assert alone.ranking("field").as_dict() == everywhere.ranking("field", place).as_dict()


def test_distances_in_no_bin_get_the_number_after_the_last():
    assert bins_of(np.array([-0.1, 0.0, 1.0, 4.99, 5.0, np.inf, np.nan]), EDGES).tolist() == [3, 0, 1, 2, 3, 3, 3]


def test_a_perfect_network_gets_1_in_every_score():
    labels = np.array([0, 1, 2, 2, 0, -1])
    probabilities = np.eye(3)[labels]
    scores = scored(probabilities, labels, np.ones(6)).ranking("ball").as_dict()
    assert scores == {"points": 2, "others": 3, "threshold": 0.5} | dict.fromkeys(
        ["average_precision", "roc_auc", "precision", "recall", "f1", "mcc", "informedness", "markedness"], 1.0
    )


def test_without_points_of_a_class_its_scores_are_none_and_not_0():
    probabilities = np.array([[0.9, 0.05, 0.05], [0.2, 0.7, 0.1]])
    scores = scored(probabilities, np.array([1, 1]), np.ones(2)).ranking("ball").as_dict()
    assert {name for name, value in scores.items() if value is None} == {
        "average_precision",
        "roc_auc",
        "recall",
        "f1",
        "mcc",
        "informedness",
        "markedness",
    }
    assert scores["precision"] == 0.0  # one point was reported, and it is wrong


def test_without_any_points_there_are_no_scores():
    empty = PointScores(CLASSES, EDGES)
    empty.add(np.zeros((0, 3)), np.zeros(0, dtype=np.int8), np.zeros(0))
    values = empty.ranking("ball", 1).as_dict()
    assert all(value is None for name, value in values.items() if name not in ("points", "others", "threshold"))
    assert json.loads(json.dumps(values, allow_nan=False)) == values
    assert len(empty.ranking("ball").precision_recall.recall) == 0
    assert empty.confusion().sum() == 0


def test_a_network_that_finds_none_of_a_class_has_recall_and_f1_of_0():
    probabilities = np.array([[0.1, 0.9, 0.0], [0.0, 0.9, 0.1]])
    found = scored(probabilities, np.array([0, 1]), np.ones(2)).ranking("ball").at(0.5)
    assert (found.recall, found.f1, found.informedness) == (0.0, 0.0, 0.0)
    assert math.isnan(found.precision)
    assert math.isnan(found.markedness)


def test_a_softmax_that_is_rounded_up_counts_as_one():
    rounded = np.array([[np.nextafter(np.float32(1.0), np.float32(2.0)), 0.0, 0.0]], dtype=np.float32)
    assert rounded.max() > 1.0
    assert scored(rounded, np.array([0]), np.ones(1)).ranking("ball").at(0.5).recall == 1.0


@pytest.mark.parametrize("wrong", [math.nan, -0.1, 1.00001, 1.1])
def test_probabilities_that_are_none_are_refused(wrong):
    with pytest.raises(ModelError, match="not all from 0 to 1"):
        scored(np.array([[wrong, 0.0, 0.0]]), np.array([0]), np.ones(1))


def test_labels_names_edges_and_sums_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="label 3 has no class"):
        scored(np.eye(3), np.array([0, 1, 3]), np.ones(3))
    with pytest.raises(InputError, match="did you mean 'ball'"):
        PointScores(CLASSES).ranking("bal")
    for edges in ([1.0], [0.0, 0.0], [0.0, math.nan]):
        with pytest.raises(InputError, match="two or more rising"):
            PointScores(CLASSES, np.array(edges))
    with pytest.raises(InputError, match="do not add up"):
        PointScores(CLASSES, EDGES) + PointScores(CLASSES)
