"""Label files in YOLO format: their place and their lines."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.output.box_files import edges
from vm_workstation.yolo_labels import LabeledBox, find_labels, parse_labels

NAMES = ("ball", "goal post")
SHARES = st.tuples(*[st.floats(0.0, 1.0)] * 2, *[st.floats(1e-3, 0.2)] * 2)


@given(
    st.lists(st.tuples(st.integers(0, 1), SHARES, st.none() | st.floats(0.0, 1.0)), max_size=5), st.sampled_from("\t ")
)
def test_boxes_are_read_as_they_were_written(boxes, space):
    values = [(number, *shares, *([] if confidence is None else [confidence])) for number, shares, confidence in boxes]
    text = "\n\n".join(space.join(map(str, each)) for each in values)
    expected = [
        LabeledBox(2 * at + 1, NAMES[number], shares, confidence)
        for at, (number, shares, confidence) in enumerate(boxes)
    ]
    assert parse_labels(text, NAMES) == (expected, [])


@given(st.text() | st.text("0123456789.-+e naif\n"))
def test_every_line_with_a_text_is_a_box_or_a_fault(text):
    for names in (NAMES, ()):
        boxes, faults = parse_labels(text, names)
        assert len(boxes) + len(faults) == sum(bool(line.strip()) for line in text.splitlines())
        assert [fault.split(":")[0][:5] for fault in faults] == ["line "] * len(faults)


@given(SHARES, st.sampled_from([(-1.5, 0.0), (1.5, 0.0), (0.0, -1.5), (0.0, 1.5)]))
def test_a_box_outside_of_the_image_is_a_fault(shares, away):
    x, y, width, height = shares
    boxes, (fault,) = parse_labels(f"0 {x + away[0]} {y + away[1]} {width} {height}", NAMES)
    assert boxes == []
    assert fault.endswith("allowed: shares of the image from 0 to 1, and at most 0.1 outside")


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("0 0.5 0.5 0.1", "'0 0.5 0.5 0.1' has 4 values; allowed: class x y width height, and perhaps a confidence"),
        ("0 0.1 0.1 0.9 0.1 0.9 0.9 0.1", "'0 0.1 0.1 0.9 0.1 0.9 0.9 0.1' has 8 values; allowed: class x y"),
        ("0 0.1 0.1 0.1 0.1 0.9 7", "'0 0.1 0.1 0.1 0.1 0.9 7' has 7 values; allowed: class x y"),
        ("0 0.1 0.1 0.9 0.1 0.9 inf", "value 7 'inf' is not a finite number"),
        ("0 0.1 0.1 0.9 0.1 0.9 1.2", "the box reaches from 0.1 to 1.2 in y"),
        ("0 0.1 0.1 0.9 0.1 0.5 0.1", "height 0 must be above 0"),
        ("0 0.5 half 0.1 0.1", "y 'half' is not a finite number"),
        ("0 0.5 0.5 nan 0.1", "width 'nan' is not a finite number"),
        ("0 0.5 0.5 0.1 0.1 inf", "confidence 'inf' is not a finite number"),
        ("0 0.5 0.5 0.1 0.1 1.5", "confidence 1.5 must be from 0 to 1"),
        ("0 0.5 0.5 0.1 0", "height 0 must be above 0"),
        ("0 0.5 0.5 -0.1 0.1", "width -0.1 must be above 0"),
        ("0 320 0.5 20 0.1", "the box reaches from 310 to 330 in x; allowed: shares of the image from 0 to 1"),
        ("0 0.5 1.04 0.1 0.06", "the box reaches from 1.01 to 1.07 in y; allowed: shares of the image"),
        ("2 0.5 0.5 0.1 0.1", "class 2 is unknown; the table of names has 0 to 1: ball, goal post"),
        ("ball 0.5 0.5 0.1 0.1", "class 'ball' is not a whole number from 0 up"),
        ("-1 0.5 0.5 0.1 0.1", "class '-1' is not a whole number from 0 up"),
    ],
)
def test_a_bad_line_is_named_and_the_rest_is_used(line, fault):
    boxes, (found,) = parse_labels(f"1 0.5 0.5 0.1 0.1\n{line}\n0 0.2 0.2 0.1 0.1\n", NAMES)
    assert found.startswith(f"line 2: {fault}")
    assert [(box.line, box.class_name) for box in boxes] == [(1, "goal post"), (3, "ball")]


@given(st.lists(st.tuples(*[st.floats(0.01, 0.99)] * 2), min_size=3, max_size=12), st.data())
def test_of_a_polygon_the_outer_box_is_read(corners, data):
    xs, ys = zip(*corners, strict=True)
    if max(xs) - min(xs) < 1e-6 or max(ys) - min(ys) < 1e-6:
        return
    order = data.draw(st.permutations(corners))
    text = " ".join(f"{x!r} {y!r}" for x, y in order)
    (box,), faults = parse_labels(f"1 {text}\n", NAMES)
    assert faults == []
    assert edges(box.shares) == pytest.approx((min(xs), min(ys), max(xs), max(ys)))
    assert box.confidence is None


@pytest.mark.parametrize(
    "line",
    [
        "0 0.5 0.5 0.05 0.04 0.5 0.5 2",  # one key point
        "0 0.5 0.5 0.05 0.04 0.5 0.5 2 0.51 0.5 1",  # two, eleven values as five corners have
        "0 0.5 0.5 0.05 0.04 0.5 0.5 2.000000 0.51 0.5 0.000000",
        "0 0.5 0.5 0.05 0.04 0.87 1",  # confidence and track
        "0 0.5 0.5 0.05 0.04 12",  # track
    ],
)
def test_boxes_with_tracks_and_key_points_are_not_taken_for_polygons(line):
    boxes, faults = parse_labels(line, NAMES)
    assert boxes == []
    assert len(faults) == 1


def test_without_names_a_class_has_its_number():
    boxes, faults = parse_labels(f"7 0.5 0.5 0.1 0.1\n007 0.5 0.5 0.1 0.1 0.3\n{'9' * 5000} 0.5 0.5 0.1 0.1\n", ())
    assert [box.class_name for box in boxes] == ["7", "7"]
    assert faults == ["line 3: class '99999999999999999999' is not a whole number from 0 up"]


@pytest.mark.parametrize(
    ("image", "places"),
    [
        ("day1/a.jpg", ["day1/a.txt", "day1/labels/a.txt"]),
        (
            "images/day1/images/cam0/a.v2.jpg",
            [
                "images/day1/images/cam0/a.v2.txt",
                "images/day1/images/cam0/labels/a.v2.txt",
                "images/day1/labels/cam0/a.v2.txt",
                "labels/day1/images/cam0/a.v2.txt",
            ],
        ),
    ],
)
def test_the_nearest_label_file_counts(image, places, tmp_path, monkeypatch):
    assert find_labels(tmp_path / image) is None
    for place in reversed([tmp_path / each for each in places]):
        place.parent.mkdir(parents=True, exist_ok=True)
        place.touch()
        assert find_labels(tmp_path / image) == place
    (tmp_path / image).parent.mkdir(parents=True, exist_ok=True)
    monkeypatch.chdir((tmp_path / image).parent)
    for place in [tmp_path / each for each in places]:
        assert find_labels(Path(tmp_path / image).relative_to(Path.cwd())) == place
        place.unlink()
    assert find_labels(tmp_path / image) is None
