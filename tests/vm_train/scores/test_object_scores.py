"""Scores of objects against their definitions, on squares whose overlaps are exact."""

import json
import math
import pickle
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_train.scores.object_scores import ObjectScores
from vm_train.scores.overlaps import TrueObject

from .test_overlaps import FoundObject

WIDTH, HEIGHT = 48, 32
EDGES = np.array([0.0, 2.0, 4.0])


@dataclass(frozen=True)
class Square:
    """Pixels from left, top on, `side` of them each way; distance [m]; confidence, or visible share."""

    left: int
    top: int
    side: int
    distance: float = 1.0
    share: float = 1.0

    @property
    def pixels(self):
        """All pixels in the picture, as a set."""
        rows, columns = range(max(self.top, 0), self.top + self.side), range(max(self.left, 0), self.left + self.side)
        return {(x, y) for x in columns for y in rows if x < WIDTH and y < HEIGHT}

    @property
    def bearing(self):
        """Unit vector to its center, for a camera with 100 px per radian near its axis."""
        ray = np.array([100.0, self.left + self.side / 2.0, self.top + self.side / 2.0])
        return ray / np.linalg.norm(ray)

    def true(self, kind=bool):
        mask = np.zeros((HEIGHT, WIDTH), dtype=kind)
        for x, y in self.pixels:
            mask[y, x] = 1
        position, angle = np.array([0.0, self.distance, 0.1]), 0.005 * self.side
        return TrueObject(mask, position, self.side / 2.0, self.share, self.bearing, angle)

    def found(self):
        corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * self.side + (self.left, self.top) - 0.5
        return FoundObject(self.share, corners, np.array([self.distance, 0.0, 0.1]), self.bearing)


def overlap(one, other):
    union = len(one.pixels | other.pixels)
    return len(one.pixels & other.pixels) / union if union else 0.0


def excused(found, truth, threshold):
    least = min(len(found.pixels), len(truth.pixels))
    return least > 0 and len(found.pixels & truth.pixels) / least >= threshold


squares = st.builds(
    Square,
    left=st.integers(-3, 12),
    top=st.integers(-3, 8),
    side=st.integers(3, 8),
    distance=st.sampled_from([0.5, 1.0, 2.0, 3.0, 4.0, 9.0]),
    share=st.sampled_from([0.1, 0.2, 0.25, 0.5, 0.75, 1.0]),
)


@st.composite
def shown_and_found(draw):
    """True squares, and found ones near them or anywhere."""
    truths = draw(st.lists(squares, max_size=4))
    found = draw(st.lists(squares, max_size=3))
    for each in truths:
        for _ in range(draw(st.integers(0, 2))):
            other = draw(squares)
            left, top = each.left + draw(st.integers(-1, 1)), each.top + draw(st.integers(-1, 1))
            found.append(replace(other, left=left, top=top, side=each.side))
    return truths, found


pictures = st.lists(shown_and_found(), max_size=4)


def scored(shown, kind=bool, **rules):
    scores = ObjectScores(EDGES, **rules)
    for truths, found in shown:
        scores.add([each.true(kind) for each in truths], [each.found() for each in found])
    return scores


def judged(shown, threshold):
    """(confidence, true square or None, found square) of all that count, and the true squares that do."""
    answers, counted = [], []
    for truths, found in shown:
        free = [each for each in truths if each.share >= 0.25]
        ignored = [each for each in truths if each.share < 0.25]
        counted += free
        for each in sorted(found, key=lambda each: -each.share):
            best = max(free, key=lambda truth: overlap(each, truth), default=None)
            if best is not None and overlap(each, best) >= threshold:
                free = [truth for truth in free if truth is not best]
                answers.append((each.share, best, each))
            elif not any(excused(each, truth, threshold) for truth in ignored):
                answers.append((each.share, None, each))
    return answers, counted


def average_precision(answers, number):
    """Each true object adds the best precision of all confidences at which as many or more are found."""
    if number == 0:
        return math.nan
    curve = []
    for level in {confidence for confidence, _, _ in answers}:
        right = [true is not None for confidence, true, _ in answers if confidence >= level]
        curve.append((sum(right), sum(right) / len(right)))
    best = [max((precision for hits, precision in curve if hits >= k), default=0.0) for k in range(1, number + 1)]
    return sum(best) / number


@given(pictures, st.sampled_from([0.5, 0.75]), st.sampled_from([bool, np.float32]))
def test_outcomes_and_average_precision_are_their_definitions(shown, threshold, kind):
    answers, counted = judged(shown, threshold)
    ranking = scored(shown, kind).ranking(threshold)
    outcome = ranking.at()
    hits = sum(true is not None for _, true, _ in answers)
    assert (outcome.hits, outcome.false, outcome.missed) == (hits, len(answers) - hits, len(counted) - hits)
    assert outcome.pictures == len(shown)
    measured = ranking.precision_recall.average_precision
    assert measured == pytest.approx(average_precision(answers, len(counted)), nan_ok=True)


@given(pictures)
def test_a_bin_has_what_truly_stands_there_and_what_is_falsely_claimed_to(shown):
    answers, counted = judged(shown, 0.5)
    for place, (low, high) in enumerate([(0.0, 2.0), (2.0, 4.0)]):
        here = [each for each in answers if low <= (each[1] or each[2]).distance < high]
        number = sum(low <= each.distance < high for each in counted)
        ranking = scored(shown).ranking(0.5, place)
        assert (ranking.truths, len(ranking.confidence)) == (number, len(here))
        assert ranking.at().hits == sum(true is not None for _, true, _ in here)
        measured = ranking.precision_recall.average_precision
        assert measured == pytest.approx(average_precision(here, number), nan_ok=True)


@given(pictures, st.sampled_from([0.0, 0.5, 1.0]))
def test_errors_are_those_of_the_right_ones_that_are_confident_enough(shown, least):
    answers, _ = judged(shown, 0.5)
    right = [
        (true.distance, found.distance)
        for confidence, true, found in answers
        if true is not None and confidence >= least
    ]
    errors = scored(shown).ranking(0.5).errors(least)
    assert errors.count == len(right)
    if right:
        true, found = np.array(right).T
        assert errors.distance_median == pytest.approx(np.median(np.abs(found - true)))
        assert errors.distance_p90 == pytest.approx(np.percentile(np.abs(found - true), 90))
        signed = [errors.low, errors.bias, errors.high]
        assert signed == pytest.approx(np.percentile(found - true, [10, 50, 90]).tolist())
        assert errors.relative_median == pytest.approx(np.median(np.abs(found - true) / true))
        assert errors.place_p90 == pytest.approx(np.percentile(np.hypot(found, true), 90))  # one ahead, one at the left


@given(pictures)
def test_center_errors_are_angles_in_radii_of_the_true_object(shown):
    right = [(true, found) for _, true, found in judged(shown, 0.5)[0] if true is not None]
    errors = scored(shown).ranking(0.5).errors()
    if right:
        angles = [math.acos(min(float(true.bearing @ found.bearing), 1.0)) for true, found in right]
        expected = [angle / (0.005 * true.side) for angle, (true, _) in zip(angles, right, strict=True)]
        assert errors.center_median == pytest.approx(np.median(expected), abs=1e-5)
        assert errors.center_p90 == pytest.approx(np.percentile(expected, 90), abs=1e-5)


@given(pictures, pictures)
def test_adding_scores_is_scoring_all_pictures_at_once_in_any_order(some, others):
    at_once = scored(some + others)
    for both in (scored(some) + scored(others), scored(others) + pickle.loads(pickle.dumps(scored(some)))):
        assert (both.pictures, both.ignored) == (at_once.pictures, at_once.ignored)
        for threshold in (0.5, 0.75):
            for place in (None, 0, 1):
                one, other = (each.ranking(threshold, place) for each in (both, at_once))
                assert one.as_dict() == other.as_dict()
                assert one.precision_recall.precision.tolist() == other.precision_recall.precision.tolist()


@given(pictures)
def test_the_curve_passes_through_the_outcomes_at_its_confidences(shown):
    ranking = scored(shown).ranking(0.5)
    curve = ranking.precision_recall
    outcomes = [ranking.at(each) for each in curve.thresholds]
    assert curve.precision == pytest.approx([each.precision for each in outcomes])
    assert curve.recall == pytest.approx([each.recall for each in outcomes], nan_ok=True)
    assert (np.diff(curve.thresholds) < 0.0).all()


def test_a_perfect_detector_gets_1_and_no_errors():
    shown = [([Square(1, 1, 5), Square(30, 20, 6, 3.0)],) * 2, ([], []), ([Square(-2, 28, 7, 1.5)],) * 2]
    for threshold in (0.5, 0.75):
        values = scored(shown).ranking(threshold).as_dict()
        assert [values[name] for name in ("average_precision", "precision", "recall", "f1")] == [1.0] * 4
        assert (values["false_per_picture"], values["errors"]["distance_p90"]) == (0.0, 0.0)


def test_the_second_detection_of_an_object_is_false():
    ball = Square(5, 5, 8)
    outcome = scored([([ball], [ball, Square(5, 6, 8, 1.0, 0.9)])]).ranking(0.5).at()
    assert (outcome.hits, outcome.false, outcome.missed) == (1, 1, 0)


def test_what_is_wrong_in_a_picture_is_told():
    missed, ball, twice = Square(20, 5, 8).true(), Square(5, 5, 8), Square(5, 6, 8, 1.0, 0.9).found()
    mistakes = ObjectScores(EDGES).add([ball.true(), missed], [ball.found(), twice])
    assert (mistakes.missed, mistakes.false) == ((missed,), (twice,))


def test_the_more_confident_chooses_first_even_if_another_fits_better():
    ball = Square(5, 5, 8, 3.0, 0.8)
    ranking = scored([([ball], [ball, Square(5, 6, 8, 2.0, 0.9)])]).ranking(0.5)
    assert ranking.confidence[ranking.right].tolist() == [0.9]
    assert ranking.errors().bias == pytest.approx(-1.0)


@pytest.mark.parametrize("ignored", [Square(5, 5, 8, 1.0, 0.2), Square(5, 5, 4, 1.0, 1.0)], ids=["hidden", "small"])
def test_ignored_objects_are_neither_missed_nor_false_if_found(ignored):
    for found in ([], [Square(5, 5, 8)], [Square(5, 5, 8), Square(4, 4, 9)]):
        scores = scored([([ignored], found)], min_radius=2.5)
        outcome = scores.ranking(0.75).at()
        assert (outcome.hits, outcome.false, outcome.missed, scores.ignored) == (0, 0, 0, 1)


def test_an_ignored_object_excuses_nothing_elsewhere_and_an_invisible_one_nothing_at_all():
    hidden = Square(5, 5, 8, 1.0, 0.2)
    assert scored([([hidden], [Square(30, 5, 8)])]).ranking(0.5).at().false == 1
    nothing = TrueObject(np.zeros((HEIGHT, WIDTH), dtype=bool), np.ones(3), 5.0, 0.0)
    scores = ObjectScores(EDGES)
    scores.add([nothing], [hidden.found()])
    assert scores.ranking(0.5).at().false == 1


def test_of_an_ignored_and_a_counted_object_the_counted_one_is_found():
    scores = scored([([Square(5, 5, 8, 1.0, 0.1), Square(5, 6, 8, 3.0)], [Square(5, 5, 8)])])
    assert scores.ranking(0.5).at().hits == 1


def test_without_objects_there_is_precision_but_no_recall():
    values = scored([([], [Square(5, 5, 8)]), ([], [])]).ranking(0.5).as_dict()
    assert (values["precision"], values["false_per_picture"]) == (0.0, 0.5)
    assert [values[name] for name in ("average_precision", "recall", "f1")] == [None] * 3
    assert set(values["errors"].values()) == {0, None}
    assert json.loads(json.dumps(values, allow_nan=False)) == values


def test_without_detections_recall_and_average_precision_are_0_and_there_is_no_precision():
    values = scored([([Square(5, 5, 8)], [])]).ranking(0.5).as_dict()
    assert (values["average_precision"], values["recall"], values["f1"], values["precision"]) == (0.0, 0.0, 0.0, None)


def test_without_pictures_there_are_no_scores():
    values = ObjectScores().ranking(0.75, 3).as_dict()
    names = ("average_precision", "precision", "recall", "f1", "false_per_picture")
    assert [values[name] for name in names] == [None] * 5


def test_objects_of_unknown_place_count_in_no_bin_and_have_no_errors():
    ball = Square(5, 5, 8)
    truth = TrueObject(ball.true().mask, np.full(3, np.nan), 4.0)
    scores = ObjectScores(EDGES)
    scores.add([truth], [ball.found()])
    assert scores.ranking(0.5).at().hits == 1
    assert scores.ranking(0.5).errors().count == 0
    assert [scores.ranking(0.5, place).truths for place in (0, 1)] == [0, 0]


def test_a_ball_straight_below_has_an_error_but_no_relative_one():
    errors = scored([([Square(5, 5, 8, 0.0)], [Square(5, 5, 8, 0.1)])]).ranking(0.5).errors()
    assert errors.distance_median == pytest.approx(0.1)
    assert math.isnan(errors.relative_median)


def test_rules_that_make_no_sense_are_refused():
    with pytest.raises(InputError, match="above 0 and at most 1"):
        ObjectScores(overlaps=(0.5, 75.0))
    with pytest.raises(InputError, match="two or more rising"):
        ObjectScores(np.array([3.0, 1.0]))
    with pytest.raises(InputError, match="no scores at overlap"):
        ObjectScores().ranking(0.6)
    with pytest.raises(InputError, match="do not add up"):
        ObjectScores() + ObjectScores(min_radius=2.0)
