"""Scores of what was found in frames with boxes."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_train.boxes.box import Box, BoxedPicture
from vm_train.boxes.unlabeled import FoundBox
from vm_train.evaluation.box_report import box_lines, box_page
from vm_train.evaluation.box_scores import SIZES, BoxScores, JudgedFrame

SIZE = (640, 480)


def box(x, y, side, name="ball"):
    return Box(name, x, y, x + side, y + side)


def frame(boxes, found, image=Path("x.jpg")):
    """A judged frame. found: pairs of a box and its confidence."""
    picture = BoxedPicture(image, SIZE, tuple(boxes), "a")
    return JudgedFrame.of(picture, "ball", [FoundBox(image, each, confidence) for each, confidence in found])


def scores(*frames, threshold=0.3):
    return BoxScores("net", threshold, frames)


def numbers(judged, size="all"):
    each = judged.as_dict()[size]
    return each["boxes"], each["found"], each["false"]


distinct = st.lists(st.tuples(st.integers(0, 5), st.integers(0, 4)), min_size=1, max_size=8, unique=True).map(
    lambda cells: [box(100.0 * x, 100.0 * y, 5.0 + 13.0 * x) for x, y in cells]
)


@given(distinct, st.floats(0.3, 1.0))
def test_who_finds_every_box_has_the_best_scores(boxes, confidence):
    judged = scores(frame(boxes, [(each, confidence) for each in boxes]))
    assert numbers(judged) == (len(boxes), len(boxes), 0)
    assert judged.as_dict()["all"]["average_precision"] == pytest.approx(1.0)
    assert judged.worst().missed == judged.worst().false == ()


@given(distinct, st.randoms())
def test_the_sizes_add_up_to_all(boxes, random):
    found = [(each if random.random() < 0.5 else box(each.left, each.top + 300.0, 20.0), 0.5) for each in boxes]
    judged = scores(frame(boxes, found))
    parts = np.sum([numbers(judged, size) for size in SIZES if size != "all"], axis=0)
    assert tuple(parts) == numbers(judged)


@given(distinct, st.floats(0.0, 1.0))
def test_the_order_of_frames_and_of_objects_does_not_matter(boxes, confidence):
    found = [(each, confidence if number % 2 else 0.4) for number, each in enumerate(boxes)]
    one, other = frame(boxes, found), frame(boxes[1:], found)
    assert scores(one, other).as_dict() == scores(frame(boxes[1:], found[::-1]), one).as_dict()


@pytest.mark.parametrize(("shift", "is_found"), [(0.0, 1), (19.0, 1), (21.0, 0), (60.0, 0)])
def test_half_of_the_union_must_be_common(shift, is_found):
    """Two squares of 60 px that are 20 px apart share 40 of 80 columns."""
    judged = scores(frame([box(100, 100, 60)], [(box(100 + shift, 100, 60), 0.9)]))
    assert numbers(judged) == (1, is_found, 1 - is_found)


def test_a_second_object_on_a_box_is_false_and_a_doubtful_one_is_not_reported():
    true = [box(100, 100, 20), box(300, 100, 70), box(0, 0, 40, "robot")]
    found = [(box(101, 100, 20), 0.6), (box(100, 100, 20), 0.9), (box(300, 100, 70), 0.2), (box(500, 300, 10), 0.1)]
    judged = scores(frame(true, found), frame([], []))
    assert numbers(judged) == (2, 1, 1)
    assert numbers(judged, "16 to 32") == (1, 1, 1)
    assert numbers(judged, "from 64") == (1, 0, 0)
    assert numbers(judged, "below 16") == (0, 0, 0)
    assert judged.as_dict()["below 16"]["recall"] is None
    # Confidences 0.9 right, 0.6 false, 0.2 right: half of the area at precision 1, half at 2/3.
    assert judged.as_dict()["all"]["average_precision"] == pytest.approx(0.5 + 0.5 * 2.0 / 3.0)
    assert numbers(scores(frame(true, found), threshold=0.05)) == (2, 2, 2)


def test_the_worst_errors_are_the_largest_miss_and_the_surest_mistake():
    true = [box(100, 100, 20), box(300, 100, 70)]
    first = frame(true, [(box(500, 300, 10), 0.5), (box(500, 200, 30), 0.8)], Path("a.jpg"))
    second = frame([box(0, 0, 90)], [], Path("b.jpg"))
    worst = scores(first, second).worst()
    assert [(each.image.name, each.rank) for each in worst.missed] == [("b.jpg", 90.0), ("a.jpg", 70.0)]
    assert [(each.rank, each.center.tolist()) for each in worst.false] == [(0.8, [515.0, 215.0])]


def test_table_and_page_show_all_networks(tmp_path):
    image = tmp_path / "frame.png"
    cv2.imwrite(str(image), np.full((480, 640, 3), 90, dtype=np.uint8))
    judged = [frame([box(100, 100, 20)], found, image) for found in ([], [(box(100, 100, 20), 0.9)])]
    both = [BoxScores("old <1>", 0.3, judged[:1] * 2), BoxScores("new", 0.3, (judged[1], judged[0]))]
    lines = box_lines(["about"], both)
    assert [line.split()[0] for line in lines[3:6:2]] == ["all", "16"]
    assert lines[4].split() == ["new", "1", "50", "%", "0", "0.500"]
    page = box_page("title", ["about <2>"], both)
    assert "old &lt;1&gt;: missed objects" in page
    assert "about &lt;2&gt;" in page
    assert page.count("data:image/jpeg") == 3
    assert "false objects" not in page
