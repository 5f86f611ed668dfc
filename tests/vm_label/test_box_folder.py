"""Folders of boxes: of vm-detect and of other tools, with faults."""

import json
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_embedded.output.box_files import edges, overlap
from vm_label import box_folder
from vm_label.box_folder import clipped, read_box_folder
from vm_label.crops import most_doubtful_first

from .made import make_folder

SHARES = st.tuples(*[st.floats(0.0, 1.0)] * 2, *[st.floats(1e-3, 1.0)] * 2)


def test_boxes_and_near_misses_come_most_doubtful_first(tmp_path):
    found = read_box_folder(make_folder(tmp_path, 4))
    crops = most_doubtful_first(found.crops)
    assert [crop.confidence for crop in crops] == [0.5, 0.623, 0.745, 0.2, 0.2, 0.2, 0.2, 0.867]
    assert len({crop.id for crop in crops}) == 8
    assert found.classes == ("ball",)
    assert found.problems == ()


def test_what_another_tool_changed_counts(tmp_path):
    make_folder(tmp_path, 3)
    (tmp_path / "image0000.txt").write_text("")  # deleted there
    (tmp_path / "image0001.txt").write_text("0 0.3 0.3 0.1 0.1\n")  # moved there
    (tmp_path / "image0002.txt").write_text("0 0.5 0.1 0.11 0.1\n")  # a near miss became a box
    crops = read_box_folder(tmp_path).crops
    assert [(crop.image[:9], crop.confidence) for crop in crops] == [
        *(("image0000", 0.2), ("image0001", None), ("image0001", 0.2), ("image0002", None))
    ]


def test_folders_of_other_tools_come_in_the_order_of_their_images(tmp_path):
    for name in ("b", "a"):
        make_folder(tmp_path / name / "images", 2)
        (tmp_path / name / "images" / "candidates.jsonl").unlink()
        (tmp_path / name / "labels").mkdir()
        for label in (tmp_path / name / "images").glob("*.txt"):
            shutil.move(label, tmp_path / name / "labels" / label.name)
    crops = most_doubtful_first(read_box_folder(tmp_path).crops)
    assert [crop.image for crop in crops] == [f"{name}/images/image000{i}.jpg" for name in "ab" for i in (0, 1)]
    assert {crop.confidence for crop in crops} == {None}
    assert {crop.class_name for crop in crops} == {"ball"}


def test_without_names_a_class_has_its_number_and_predictions_keep_their_confidence(tmp_path):
    make_folder(tmp_path, 1, near=False)
    (tmp_path / "classes.txt").unlink()
    (tmp_path / "candidates.jsonl").unlink()
    (tmp_path / "image0000.txt").write_text("7 0.5 0.5 0.2 0.2 0.31\n0 0.2 0.2 0.1 0.1\n")
    assert [(crop.class_name, crop.confidence) for crop in read_box_folder(tmp_path).crops] == [
        ("7", 0.31),
        ("0", None),
    ]
    assert len(read_box_folder(tmp_path, ["0"]).crops) == 1
    with pytest.raises(InputError, match=r"unknown class '8'.*allowed: 7, 0"):
        read_box_folder(tmp_path, ["8"])


def test_a_bad_line_is_named_and_the_rest_is_used(tmp_path):
    make_folder(tmp_path, 3, near=False)
    (tmp_path / "image0001.txt").write_text("1 0.5 0.5 0.1 0.1\n0 0.5 0.5 0.2 0.2\n")
    (tmp_path / "image0002.txt").write_bytes(b"\xff\xfe")
    found = read_box_folder(tmp_path)
    assert found.problems == (
        f"{tmp_path}/image0001.txt line 1: class 1 is unknown; the table of names has 0 to 0: ball",
        f"can't read {tmp_path}/image0002.txt: it is not UTF-8 text",
    )
    assert found.faulty == {"image0001.jpg", "image0002.jpg"}
    assert len(found.crops) == 2


def test_folders_may_number_the_same_classes_differently(tmp_path):
    make_folder(tmp_path / "day1", 1, near=False, classes=("ball", "robot"))
    make_folder(tmp_path / "day2", 1, near=False, classes=("robot", "ball"))
    found = read_box_folder(tmp_path)
    assert [crop.class_name for crop in found.crops] == ["ball", "robot"]
    assert found.classes == ("ball", "robot")


def test_bad_candidates_and_images_with_one_name_are_named(tmp_path):
    make_folder(tmp_path, 2)
    lines = (tmp_path / "candidates.jsonl").read_text().splitlines()
    wrong = json.dumps(json.loads(lines[0]) | {"confidence": 7})
    (tmp_path / "candidates.jsonl").write_text("\n".join([*lines, "[]", wrong, lines[0][:30]]))
    shutil.copy(tmp_path / "image0001.jpg", tmp_path / "image0001.png")
    found = read_box_folder(tmp_path)
    assert len(found.crops) == 2
    assert [problem.split(": ")[1][:7] for problem in found.problems if "candidates.jsonl" in problem] == [
        *("line 5 ", "line 6 ", "line 7 ")
    ]
    assert sum("ambiguous" in problem for problem in found.problems) == 2
    assert found.faulty == {"image0001.jpg", "image0001.png"}


def test_folders_without_images_or_with_bad_classes_are_refused(tmp_path):
    with pytest.raises(InputError, match="no images"):
        read_box_folder(tmp_path)
    with pytest.raises(InputError, match="can't read"):
        read_box_folder(tmp_path / "missing")
    make_folder(tmp_path, 1, classes=("ball", "ball"))
    with pytest.raises(InputError, match="a name twice"):
        read_box_folder(tmp_path)


@given(SHARES)
def test_a_box_is_clipped_to_the_image(shares):
    expected = np.clip(edges(shares), 0.0, 1.0)
    np.testing.assert_allclose(edges(clipped(shares)), expected, rtol=0.0, atol=1e-12)
    if (expected == edges(shares)).all():
        assert clipped(shares) == shares


def candidate_lines(boxes):
    fields = {"image": "image0000.jpg", "class": "ball", "confidence": 0.2, "found": False}
    return "".join(json.dumps(fields | {"box": box}) + "\n" for box in boxes)


@given(st.lists(SHARES, max_size=12), st.lists(SHARES, max_size=5))
@example([(0.0, 0.0, 1.0, 1.0), (0.5, 0.5, 1.0, 1.0)], [(0.5, 0.5, 1.0, 1.0)])  # a near miss that became a box
def test_a_near_miss_at_the_place_of_another_box_is_left_out(misses, labels):
    with tempfile.TemporaryDirectory() as place:
        folder = make_folder(Path(place), 1, near=False)
        (folder / "image0000.txt").write_text("".join(f"0 {' '.join(map(repr, each))}\n" for each in labels))
        left = [crop.shares for crop in read_box_folder(folder).crops]
        (folder / "candidates.jsonl").write_text(candidate_lines(misses))
        crops = read_box_folder(folder).crops
    for each in misses:
        if all(overlap(edges(each), edges(other)) <= 0.5 for other in left):
            left.append(each)
    assert [crop.shares for crop in crops] == left


def test_thousands_of_near_misses_are_compared_with_few(tmp_path, monkeypatch):
    compared = []
    monkeypatch.setattr(box_folder, "overlap", lambda one, other: compared.append(0) or overlap(one, other))
    folder, count = make_folder(tmp_path, 1), 2000
    corners = np.random.default_rng(1).uniform(0.1, 0.9, (count, 2)).tolist()
    (folder / "candidates.jsonl").write_text(candidate_lines([(*each, 0.01, 0.01) for each in corners]))
    assert len(read_box_folder(folder).crops) > count / 2
    assert len(compared) < 50 * count
