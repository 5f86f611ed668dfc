"""An object whose box can't be read never becomes background: its outer box is read, or its frame is left out."""

import json
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.programs import run_program
from vm_train.boxes.outer_box import outer_box, outer_box_of_turned
from vm_train.boxes.read import read_boxes

from .written import boxes_of, coco_table, voc_text, write_coco, write_image, write_voc, write_yolo

BALL = ("ball", 20.0, 30.0, 40.0, 50.0)
GOOD = {"good1": [BALL], "good2": []}
LINE = "0 0.1875 0.333333 0.125 0.166667\n"
"""BALL in YOLO format."""


def around(edges):
    """Edges of a box, as `Box` has them."""
    return pytest.approx([each - 0.5 for each in edges], abs=1e-3)


def test_the_case(shared):
    folder = shared / "cases/boxes/mixed"
    if not folder.is_dir():
        pytest.skip("needs ../shared/cases")
    done = run_program("vm-train", "check", folder, "--boxes", "--no-look", "--verbose", code=1)
    assert "1 pictures can be used" in done.stdout
    for name in ("1", "5"):
        assert re.search(rf"\b{name}\.txt line 1: .*\b{name}\.jpg not used", done.stderr)
    found = read_boxes(folder)
    (picture,) = found.pictures
    (box,) = picture.boxes
    width, height = picture.size
    assert box.edges == around((0.2 * width, 0.3 * height, 0.25 * width, 0.35 * height))


@pytest.mark.parametrize(
    "line",
    [
        "0 0.5 0.5 0.05 0.04 0.5 0.5 2",
        "0 0.5 0.5 0.05 0.04 0.9 17",
        "0 0.5 0.5 0.05 0.04 17",
        "1 0.5 0.5 0.05 0.04",
        "ball 0.5 0.5 0.05 0.04",
        "0 0.5 0.5 0 0.04",
        "0 320 240 20 20",
        "0 0.98 0.5 0.1 0.1",
        "0 0.5 0.5",
    ],
)
def test_a_line_of_yolo_that_is_no_box_leaves_out_its_frame_only(line, tmp_path):
    write_yolo(tmp_path, {**GOOD, "a": [BALL]})
    (tmp_path / "a.txt").write_text(f"{LINE}{line}\n")
    boxes, faults = boxes_of(tmp_path)
    assert list(boxes) == list(GOOD)
    assert len(faults) == 1
    assert "a.txt line 2" in faults[0]


@pytest.mark.parametrize(
    ("change", "spoils"),
    [
        ({"iscrowd": 1}, True),
        ({"category_id": 9}, True),
        ({"category_id": None}, True),
        ({"bbox": None}, True),
        ({"bbox": [], "segmentation": []}, True),
        ({"bbox": [1, 2, 3, 4, 0.5]}, True),
        ({"bbox": [0, 0, 0, 0], "segmentation": {"counts": "abc", "size": [120, 160]}}, True),
        ({"bbox": [0, 0, 0, 0], "segmentation": [[1, 2, 3, 4]]}, True),
        ({"attributes": {"rotation": "much"}}, True),
        ({"attributes": {"rotation": 0.0}, "iscrowd": 0}, False),
        ({"attributes": {"occluded": True}}, False),
        ({"attributes": []}, False),
    ],
)
def test_an_annotation_of_coco_that_is_no_box_leaves_out_its_frame_only(change, spoils, tmp_path):
    write_coco(tmp_path, {**GOOD, "a": [BALL, BALL]})
    path = tmp_path / "instances.json"
    table = json.loads(path.read_text())
    table["annotations"][-1].update(change, bbox=change.get("bbox", [90, 30, 20, 20]))
    path.write_text(json.dumps(table))
    boxes, faults = boxes_of(tmp_path)
    assert list(boxes) == ["good1", "good2"] if spoils else ["a", "good1", "good2"]
    assert len(faults) == spoils
    assert not spoils or ("annotation 3" in faults[0] and "a.jpg" in faults[0])


def test_an_image_of_coco_whose_number_is_a_text_elsewhere_keeps_its_boxes(tmp_path):
    write_coco(tmp_path, {**GOOD, "a": [BALL]})
    path = tmp_path / "instances.json"
    table = json.loads(path.read_text())
    for each in table["annotations"]:
        each["image_id"] = str(each["image_id"])
    path.write_text(json.dumps(table))
    boxes, faults = boxes_of(tmp_path)
    assert [len(each) for each in boxes.values()] == [1, 1, 0]
    assert faults == []


@pytest.mark.parametrize("key", [[1], {}, None, 0.5, True, "12 ", 10**30])
def test_an_annotation_of_coco_without_an_image_is_a_fault_of_its_own(key, tmp_path):
    write_coco(tmp_path, {**GOOD, "a": [BALL]})
    path = tmp_path / "instances.json"
    table = json.loads(path.read_text())
    table["annotations"].append({"id": 9, "image_id": key, "category_id": 3, "bbox": [1, 2, 30, 30]})
    path.write_text(json.dumps(table))
    boxes, faults = boxes_of(tmp_path)
    assert [len(each) for each in boxes.values()] == [1, 1, 0]
    assert len(faults) == 1
    assert "annotation 9" in faults[0]


def test_a_number_and_a_text_are_two_ids_of_coco_if_both_are_there(tmp_path):
    write_coco(tmp_path, {"a": [BALL], "b": []})
    path = tmp_path / "instances.json"
    table = json.loads(path.read_text())
    table["images"][1]["id"] = str(table["images"][0]["id"])
    path.write_text(json.dumps(table))
    boxes, _ = boxes_of(tmp_path)
    assert {name: len(each) for name, each in boxes.items()} == {"a": 1, "b": 0}


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, -45.0])
def test_oriented_boxes_of_cvat_and_polygons_of_coco_give_outer_boxes(angle, tmp_path):
    table = coco_table({"a": [BALL], "b": [BALL]})
    first, second = table["annotations"]
    corners = turned((20.0, 30.0, 40.0, 60.0), math.radians(angle))
    first.update(bbox=[20.0, 30.0, 20.0, 30.0], attributes={"rotation": angle})
    second.update(bbox=[], segmentation=[[each for corner in corners for each in corner]])
    for name in "ab":
        write_image(tmp_path / f"{name}.jpg")
    (tmp_path / "instances.json").write_text(json.dumps(table))
    boxes, faults = boxes_of(tmp_path)
    assert faults == []
    assert boxes["a"][0].edges == around(outer_box(corners))
    assert boxes["b"][0].edges == around(outer_box(corners))


def turned(edges, angle):
    """The corners of a box that is turned around its middle."""
    left, top, right, bottom = edges
    x, y = (left + right) / 2, (top + bottom) / 2
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    return [
        (
            x + (u - x) * math.cos(angle) - (v - y) * math.sin(angle),
            y + (u - x) * math.sin(angle) + (v - y) * math.cos(angle),
        )
        for u, v in corners
    ]


@given(st.tuples(*[st.floats(-50.0, 50.0)] * 2, *[st.floats(51.0, 200.0)] * 2), st.floats(-7.0, 7.0))
def test_the_outer_box_of_a_turned_box_touches_its_corners(edges, angle):
    assert outer_box_of_turned(edges, angle) == pytest.approx(outer_box(turned(edges, angle)), abs=1e-9)


ROTATION = "<attributes><attribute><name>rotation</name><value>{}</value></attribute></attributes>"


@pytest.mark.parametrize(
    ("entry", "edges"),
    [
        (f"<bndbox><xmin>20</xmin><ymin>30</ymin><xmax>40</xmax><ymax>60</ymax></bndbox>{ROTATION.format(90.0)}",
         (15.0, 35.0, 45.0, 55.0)),
        (f"<bndbox><xmin>20</xmin><ymin>30</ymin><xmax>40</xmax><ymax>60</ymax></bndbox>{ROTATION.format(0.0)}",
         (20.0, 30.0, 40.0, 60.0)),
        ("<robndbox><cx>30</cx><cy>45</cy><w>20</w><h>30</h><angle>1.5707963</angle></robndbox>",
         (15.0, 35.0, 45.0, 55.0)),
        ("<polygon><x1>20</x1><y1>30</y1><x2>40</x2><y2>35</y2><x3>30</x3><y3>50</y3></polygon>",
         (20.0, 30.0, 40.0, 50.0)),
        ("<polygon><x1>20</x1><y1>30</y1><x2>40</x2><y2>35</y2></polygon>", None),
        ("<polygon><x1>20</x1><y1>30</y1><x2>40</x2><y2>35</y2><x3>3</x3><y4>50</y4></polygon>", None),
        ("<robndbox><cx>30</cx><cy>45</cy><w>20</w></robndbox>", None),
        ("<point><x>3</x><y>4</y></point>", None),
        (f"<bndbox><xmin>20</xmin><ymin>30</ymin><xmax>40</xmax><ymax>60</ymax></bndbox>{ROTATION.format('x')}", None),
    ],
)  # fmt: skip
def test_objects_of_voc_are_read_by_their_outer_box_or_leave_out_their_frame(entry, edges, tmp_path):
    write_voc(tmp_path, {**GOOD, "a": [BALL]})
    bad = f"<object><name>goal</name>{entry}</object></annotation>"
    (tmp_path / "a.xml").write_text(voc_text("a.jpg", [BALL]).replace("</annotation>", bad))
    boxes, faults = boxes_of(tmp_path)
    if edges is None:
        assert list(boxes) == list(GOOD)
        (fault,) = faults
        assert "a.xml object 2: goal" in fault
    else:
        assert faults == []
        assert boxes["a"][1].edges == around(edges)
