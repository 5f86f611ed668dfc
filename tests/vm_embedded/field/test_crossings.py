"""Crossings have their kind, place and heading; goals are pairs of posts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.field.crossings import find_crossings
from vm_embedded.field.features import Segment, Upright
from vm_embedded.field.find import pair_posts

from .ground import turned


def line(start, end, angle=0.0, confidence=0.9):
    return Segment(np.array([start, end], dtype=float) @ turned(angle), np.zeros((2, 2)), confidence)


def everywhere(places):
    return np.ones(len(places), dtype=bool)


ACROSS = ((2.0, -1.5), (2.0, 1.5))


@pytest.mark.parametrize(
    ("other", "kind", "heading"),
    [
        (((0.5, 0.0), (3.5, 0.0)), "X", 0.0),
        (((2.0, 0.0), (4.0, 0.0)), "T", 0.0),
        (((2.1, 0.5), (4.0, 0.5)), "T", 0.0),
        (((0.5, 1.0), (2.0, 1.0)), "T", np.pi),
        (((2.0, 1.5), (4.0, 1.5)), "L", -np.pi / 4.0),
        (((2.0, -1.5), (0.5, -1.5)), "L", 3.0 * np.pi / 4.0),
    ],
)
@given(angle=st.floats(-3.1, 3.1))
def test_kind_and_heading(other, kind, heading, angle):
    found = find_crossings([line(*ACROSS, angle), line(*other, angle)], everywhere)
    assert [each.kind for each in found] == [kind]
    turn = np.pi / 2.0 if kind == "X" else 2.0 * np.pi
    off = (found[0].heading - heading - angle) % turn
    assert min(off, turn - off) < 1e-6
    assert found[0].position @ turned(-angle) == pytest.approx([2.0, other[0][1]], abs=1e-9)


@pytest.mark.parametrize("other", [((3.0, 0.0), (5.0, 0.0)), ((2.5, -1.5), (2.5, 1.5)), ((2.0, 0.0), (4.0, 1.5))])
def test_lines_that_do_not_meet_at_a_right_angle_have_none(other):
    assert find_crossings([line(*ACROSS), line(*other)], everywhere) == ()


def test_at_the_edge_of_the_frame_the_kind_is_unknown():
    lines = [line(*ACROSS), line((2.0, 0.0), (4.0, 0.0))]
    assert find_crossings(lines, lambda places: places[:, 0] > 1.9) == ()


def test_one_line_has_no_crossing():
    assert find_crossings([line(*ACROSS)], everywhere) == ()


def post(x, y):
    place = np.array([x, y], dtype=float)
    return Upright("post", 0.9, place, float(np.hypot(*place)), np.array([1.0, 0.0, 0.0]), np.zeros(2), 0.1)


def test_posts_at_a_goals_width_are_a_goal_with_its_left_post_first():
    posts = [post(4.0, -0.9), post(4.0, 0.9), post(-3.0, 0.0)]
    assert pair_posts(posts) == ((1, 0),)


def test_a_post_belongs_to_one_goal():
    posts = [post(4.0, 0.0), post(4.0, 1.6), post(4.0, 3.4)]
    assert pair_posts(posts) == ((1, 0),)


def test_posts_too_near_or_too_far_apart_are_no_goal():
    assert pair_posts([post(4.0, 0.0), post(4.0, 0.5), post(4.0, 5.0)]) == ()


def test_a_line_in_two_pieces_makes_no_wrong_corners():
    lines = [line((2.0, -1.5), (2.0, -0.2)), line((2.0, 0.2), (2.0, 1.5)), line((2.1, 0.0), (4.0, 0.0))]
    assert find_crossings(lines, everywhere) == ()


AHEAD = ((2.0, 0.0), (4.0, 0.0))


@pytest.mark.parametrize(
    ("again", "kind"),
    [
        (((2.12, -1.0), (2.12, 1.4)), "T"),  # beside the line
        (((1.9, 1.0), (2.05, -0.8)), "T"),  # turned a little, and from the other end
        (((2.0, -0.6), (2.0, 0.7)), "T"),  # on the line
        (((2.2, 0.1), (2.2, 3.0)), "T"),  # longer at one end
    ],
)
@given(angle=st.floats(-3.1, 3.1), is_first=st.booleans())
def test_a_line_that_was_found_twice_crosses_once(again, kind, angle, is_first):
    lines = [line(*ACROSS, angle), line(*again, angle, 0.5)]
    (found,) = find_crossings([*(lines if is_first else reversed(lines)), line(*AHEAD, angle)], everywhere)
    assert found.kind == kind
    assert np.hypot(*(found.position @ turned(-angle) - (2.0, 0.0))) < 0.25


def test_a_line_that_was_found_twice_has_the_ends_of_both():
    lines = [line((2.0, -1.5), (2.0, 0.1)), line((2.1, -0.4), (2.1, 1.0)), line(*AHEAD)]
    assert [each.kind for each in find_crossings(lines, everywhere)] == ["T"]
    assert [each.kind for each in find_crossings([lines[0], lines[2]], everywhere)] == ["L"]


@given(angle=st.floats(-3.1, 3.1), far=st.floats(8.0, 9.5))
def test_far_lines_that_were_found_twice_cross_once(angle, far):
    lines = [line((far, -2.0), (far, 2.0), angle), line((far + 0.42, -1.9), (far + 0.42, 1.5), angle)]
    (found,) = find_crossings([*lines, line((far, 0.0), (far - 4.0, 0.0), angle)], everywhere)
    assert found.kind == "T"


@given(angle=st.floats(-3.1, 3.1), distance=st.floats(1.0, 9.0))
def test_lines_as_far_apart_as_those_of_a_field_cross_twice(angle, distance):
    lines = [line((distance + off, -2.0), (distance + off, 2.0), angle) for off in (0.0, 0.6)]
    found = find_crossings([*lines, line((distance - 1.0, 0.0), (distance + 2.0, 0.0), angle)], everywhere)
    assert [each.kind for each in found] == ["X", "X"]


@given(one=st.floats(0.1, 1.0), other=st.floats(0.1, 1.0), gap=st.floats(0.0, 0.4))
def test_confidence_is_that_of_both_lines_and_less_behind_a_gap(one, other, gap):
    ends = (2.0 + gap, 0.0), (4.0, 0.0)
    (found,) = find_crossings([line(*ACROSS, confidence=one), line(*ends, confidence=other)], everywhere)
    allowed = 0.35 + 0.05 * 2.0
    assert found.confidence == pytest.approx(one * other * (1.0 - 0.5 * gap / allowed))
    assert found.as_dict()["confidence"] == round(found.confidence, 3)
