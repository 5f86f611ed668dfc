"""Scores of points against their definitions, spelled out point by point."""

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given

from vm_embedded.errors import InputError, ModelError
from vm_train.scores.distance_bins import bins_of
from vm_train.scores.point_scores import PointScores

from .test_point_ranking import CLASSES, EDGES, points, scored


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


@given(points)
def test_several_distance_bins_score_the_points_of_all_of_them(given_points):
    probabilities, labels, distances = given_points
    here = (distances >= EDGES[0]) & (distances < EDGES[2])
    alone, everywhere = scored(probabilities[here], labels[here], distances[here]), scored(*given_points)
    for name in CLASSES:
        assert everywhere.ranking(name, range(2)).as_dict() == alone.ranking(name).as_dict()


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
