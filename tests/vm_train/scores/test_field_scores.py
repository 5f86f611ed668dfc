"""Scores of field features against hand-made cases and their laws."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_train.scores.border_scores import BorderScores, distances_along
from vm_train.scores.field_scores import FieldScores, FieldTruth, LineScores, TrueField, tolerances
from vm_train.scores.line_shapes import STEP, Lines
from vm_train.scores.upright_scores import TrueUpright, UprightScores

from ..fields import features

NOTHING = np.zeros((0, 2))
SQUARE = np.array([(2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0), (2.0, -2.0), (2.0, 2.0)])

places = st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)).map(np.array)
uprights = st.builds(TrueUpright, places, st.sampled_from([0.1, 0.5]), st.booleans())


def post(x, y=0.0, width=0.1, visible=True):
    return TrueUpright(np.array([x, y]), width, visible)


def at(*found):
    return [np.array(each, dtype=float) for each in found]


def scored(truths, found, people=(), tolerance=0.05, limit=8.0):
    scores = UprightScores(tolerance, limit)
    scores.add(truths, found, people)
    return scores


def test_the_truth_itself_is_found_without_error():
    truths = [post(1.0), post(3.0, 1.0), post(7.0, -2.0)]
    row = scored(truths, [each.position for each in truths]).near_row()
    assert (row["visible"], row["found"], row["recall"], row["false"], row["people"]) == (3, 3, 1.0, 0, 0)
    assert row["error_median"] == row["relative_error_median"] == 0.0


@pytest.mark.parametrize(("share", "found", "false"), [(0.04, 1, 0), (0.06, 0, 0), (0.09, 0, 0), (0.11, 0, 1)])
def test_a_shifted_report_is_found_up_to_5_percent_and_false_from_10_percent(share, found, false):
    row = scored([post(4.0)], at((4.0 * (1.0 + share), 0.0))).row()
    assert (row["found"], row["false"]) == (found, false)
    assert row["relative_error_median"] == (None if false else pytest.approx(share))
    assert row["error_median"] == (None if false else pytest.approx(4.0 * share))


def test_confidences_are_judged_by_the_reports_that_are_found_or_false():
    """A report that is near a base, and one at a person, is neither."""
    scores = UprightScores(0.05, 8.0)
    found = at((4.0, 0.1), (7.0, 3.0), (2.15, -1.0), (5.0, -2.0))
    scores.add([post(4.0), post(2.0, -1.0)], found, [post(5.0, -2.0)], [0.9, 0.2, 0.6, 0.7])
    scores.add([post(3.0)], at((3.0, 0.0)), (), [0.5])
    ranking = scores.ranking()
    assert ranking.confidence.tolist() == [0.9, 0.2, 0.5]
    assert ranking.right.tolist() == [True, False, True]
    assert (ranking.truths, ranking.pictures) == (3, 2)


def test_a_second_report_of_the_same_post_is_false():
    row = scored([post(4.0)], at((4.0, 0.0), (4.0, 0.1))).row()
    assert (row["found"], row["reported"], row["false"], row["error_median"]) == (1, 2, 1, 0.0)


def test_of_two_bases_each_gets_its_own_report():
    row = scored([post(4.0), post(4.0, 0.15)], at((4.0, 0.1), (4.0, 0.17))).row()
    assert (row["found"], row["false"]) == (2, 0)


def test_a_report_of_a_hidden_base_is_neither_found_nor_false():
    row = scored([post(4.0, visible=False)], at((4.1, 0.0))).row()
    assert (row["visible"], row["found"], row["reported"], row["false"], row["recall"]) == (0, 0, 1, 0, None)


def test_a_visible_base_comes_before_a_hidden_one():
    row = scored([post(4.0, visible=False), post(4.0, 0.3)], at((4.0, 0.15))).row()
    assert (row["found"], row["false"]) == (1, 0)


def test_reports_inside_a_wide_foot_are_not_false():
    assert scored([post(1.0, width=0.8)], at((1.3, 0.0))).row()["false"] == 0
    assert scored([post(1.0, width=0.1)], at((1.3, 0.0))).row()["false"] == 1


def test_reports_at_people_are_counted_apart():
    row = scored([post(2.0)], at((4.0, 0.0), (4.0, 0.2), (6.0, 3.0)), people=[post(4.1, width=0.5)]).row()
    assert (row["people"], row["false"], row["found"]) == (2, 1, 0)


def test_bins_are_those_of_the_base_and_of_the_report():
    scores = scored([post(1.0), post(9.0), post(20.0)], at((9.0, 0.0), (5.0, 0.0), (3.0, 3.0)))
    found = scores.as_dict()
    assert [found[each]["visible"] for each in ("0-2", "2-4", "4-6", "6-8", "8-10", "all", "near")] == [
        1,
        0,
        0,
        0,
        1,
        3,
        1,
    ]
    assert [found[each]["false"] for each in ("0-2", "2-4", "4-6", "8-10", "all", "near")] == [0, 0, 2, 0, 2, 2]
    assert found["8-10"]["recall"] == 1.0


@given(st.lists(st.tuples(st.lists(uprights, max_size=4), st.lists(places, max_size=4)), max_size=4), st.integers(0, 4))
def test_parts_add_up(pictures, split):
    parts = [UprightScores(0.05, 8.0) for _ in range(3)]
    for number, (truths, found) in enumerate(pictures):
        for scores in (parts[0], parts[1 + (number >= split)]):
            scores.add(truths, found)
    assert (parts[1] + parts[2]).as_dict() == parts[0].as_dict()


@given(st.lists(uprights, max_size=5), st.lists(places, max_size=5), st.lists(uprights, max_size=3))
def test_every_report_has_one_outcome(truths, found, people):
    row = scored(truths, found, people).row()
    assert row["visible"] == sum(each.visible for each in truths)
    assert row["found"] <= min(row["visible"], row["reported"])
    assert row["found"] + row["false"] + row["people"] <= row["reported"] == len(found)


def test_rules_that_differ_do_not_add_up():
    with pytest.raises(InputError, match="do not add up"):
        UprightScores(0.05, 8.0) + UprightScores(0.08, 8.0)
    with pytest.raises(InputError, match="do not add up"):
        LineScores(6.0) + LineScores(8.0)
    with pytest.raises(InputError, match="do not add up"):
        BorderScores() + BorderScores(np.array([0.0, 1.0]))


def test_samples_of_a_line_stand_for_its_length():
    lines = Lines(np.array([[(0.0, 0.0), (3.0, 4.0)]]), [(np.array([1.0, 1.0]), 0.75)])
    samples = lines.samples()
    assert len(samples) * STEP == pytest.approx(5.0 + 1.5 * math.pi, abs=0.03)
    assert lines.distances(samples).max() < 1e-9
    assert Lines(np.array([[(0.0, 0.0), (1.0, 0.0)]])).distances(np.array([(2.0, 0.0), (0.5, -0.3)])).tolist() == [
        1.0,
        0.3,
    ]
    assert np.isinf(Lines(np.zeros((0, 2, 2))).distances(samples)).all()


def line_row(true, reported, near=False):
    scores = LineScores()
    scores.add(true, true.samples(), reported, reported.samples())
    return scores.near_row() if near else scores.row()


STRAIGHT = Lines(np.array([[(2.0, -1.0), (2.0, 1.0)]]))


@pytest.mark.parametrize(("shift", "recall", "wrong"), [(0.0, 1.0, 0.0), (0.04, 1.0, 0.0), (0.2, 0.0, 1.0)])
def test_lines_within_the_tolerance_are_found_and_not_wrong(shift, recall, wrong):
    row = line_row(STRAIGHT, Lines(STRAIGHT.segments + np.array([shift, 0.0])))
    assert (row["recall"], row["wrong_share"]) == (recall, wrong)
    assert row["visible"] == row["reported"] == pytest.approx(2.0, abs=0.02)


def test_half_a_line_is_half_of_the_length():
    row = line_row(STRAIGHT, Lines(np.array([[(2.0, 0.0), (2.0, 1.0)]])))
    assert row["recall"] == pytest.approx(0.5, abs=0.04)  # the end reaches 6 cm further
    assert row["wrong_share"] == 0.0


def test_the_tolerance_grows_with_the_distance():
    assert tolerances(np.array([(1.0, 0.0), (5.0 / 3.0, 0.0), (0.0, 6.0)])).tolist() == pytest.approx(
        [0.05, 0.05, 0.18]
    )


def test_a_circle_counts_as_a_line():
    circle = Lines(np.zeros((0, 2, 2)), [(np.array([3.0, 0.0]), 0.75)])
    assert line_row(circle, circle)["recall"] == 1.0
    assert line_row(circle, Lines(np.zeros((0, 2, 2)), [(np.array([3.0, 0.0]), 1.0)]))["wrong_share"] == 1.0


def test_the_limit_of_lines_leaves_out_what_is_beyond():
    far = Lines(np.array([[(5.0, 0.0), (7.0, 0.0)]]))
    assert line_row(far, far, near=True)["visible"] == pytest.approx(1.0, abs=0.03)


@given(st.lists(places, min_size=2, max_size=6), st.lists(places, min_size=2, max_size=6))
def test_shares_of_lines_are_shares(true, reported):
    row = line_row(*(Lines(np.array(each[: len(each) // 2 * 2]).reshape(-1, 2, 2)) for each in (true, reported)))
    assert row["recall"] is None or 0.0 <= row["recall"] <= 1.0
    assert row["wrong_share"] is None or 0.0 <= row["wrong_share"] <= 1.0


def test_distances_along_a_square():
    directions = np.radians([0.0, 45.0, 90.0, 180.0, -90.0, 30.0])
    expected = [2.0, 2.0 * math.sqrt(2.0), 2.0, 2.0, 2.0, 2.0 / math.cos(math.radians(30.0))]
    assert distances_along(SQUARE, directions) == pytest.approx(expected)
    assert np.isnan(distances_along(SQUARE[1:3], np.array([0.0]))).all()
    assert np.isnan(distances_along(NOTHING, np.array([0.0]))).all()


def border_row(reported, directions=(0.0, 0.5, 1.0)):
    scores = BorderScores()
    directions = np.array(directions)
    scores.add(directions, distances_along(SQUARE, directions), reported)
    return scores.row()


def test_a_border_of_the_wrong_size_has_its_error():
    assert border_row(SQUARE) == {"directions": 3, "reported_share": 1.0, "error_median": 0.0, "error_p90": 0.0}
    assert border_row(SQUARE * 1.06)["error_median"] == pytest.approx(0.06)
    assert border_row(SQUARE * 0.98)["error_median"] == pytest.approx(0.02)


def test_a_border_that_is_not_reported_has_no_error():
    assert border_row(None) == {"directions": 3, "reported_share": 0.0, "error_median": None, "error_p90": None}
    assert border_row(np.array([(2.0, -2.0), (2.0, 1.0)]))["reported_share"] == pytest.approx(1.0 / 3.0)


def test_a_border_that_the_picture_does_not_show_is_counted():
    scores = BorderScores()
    scores.add(np.zeros(0), np.zeros(0), SQUARE)
    scores.add(np.zeros(0), np.zeros(0), None)
    assert (scores.unasked, scores.pictures, scores.row()["directions"]) == (1, 2, 0)


def truth(uprights=None, field=None):
    return FieldTruth(uprights, field, lambda places: places[:, 0] > 3.0)


def test_a_circle_counts_only_where_it_is_inside_the_picture():
    scores = FieldScores()
    circle = (np.array([3.0, 0.0]), 0.5)
    lines = Lines(np.zeros((0, 2, 2)), [circle])
    visible = lines.samples()[lines.samples()[:, 0] > 3.0]
    scores.add(truth(field=TrueField(lines, visible, np.zeros(0), np.zeros(0))), features(circle=circle))
    row = scores.lines.row()
    assert row["reported"] == row["visible"] == pytest.approx(0.5 * math.pi, abs=0.05)
    assert (row["recall"], row["wrong_share"]) == (1.0, 0.0)


def test_pictures_without_truth_count_in_no_score():
    scores = FieldScores()
    scores.add(truth(), features(posts=[(1.0, 0.0)], lines=[((1.0, 0.0), (2.0, 0.0))]))
    assert [each["pictures"] for each in scores.as_dict().values()] == [0, 0, 0, 0]
    scores.add(truth({"post": [], "robot": [], "person": []}), features(posts=[(1.0, 0.0)], robots=[(2.0, 0.0)]))
    found = scores.as_dict()
    assert [each["pictures"] for each in found.values()] == [1, 1, 0, 0]
    assert (found["posts"]["all"]["false"], found["robots"]["all"]["false"]) == (1, 1)
    json.dumps(found, allow_nan=False)


def test_field_scores_add_up():
    one, other = FieldScores(), FieldScores()
    by_kind = {"post": [post(4.0)], "robot": [post(2.0, 1.0)], "person": []}
    lines = TrueField(STRAIGHT, STRAIGHT.samples(), np.array([0.0]), np.array([2.0]))
    one.add(truth(by_kind, lines), features(posts=[(4.0, 0.0)], border=SQUARE))
    other.add(truth(by_kind, lines), features(robots=[(2.0, 1.0)], lines=STRAIGHT.segments))
    both = (one + other).as_dict()
    assert [both[each]["all"]["recall"] for each in ("posts", "robots", "lines")] == [0.5, 0.5, 0.5]
    assert both["border"]["all"]["reported_share"] == 0.5
