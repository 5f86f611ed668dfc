"""Broken data sets in each format: one line for each fault, and the good part is used."""

import json
import math

import pytest

from vm_train.boxes.read import read_boxes

from .written import boxes_of, coco_table, voc_text, write_coco, write_image, write_voc, write_yolo

BALL = ("ball", 20.0, 30.0, 40.0, 50.0)
GOAL = ("goal", 100.0, 10.0, 110.0, 90.0)
GOOD = {"good1": [BALL], "good2": [BALL, GOAL], "good3": []}
GOOD_COUNTS = {"good1": 1, "good2": 2, "good3": 0}


def cut(path, share=0.5):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])


def check(folder, faults, counts, **options):
    """The exact faults, and the number of boxes of each usable picture."""
    boxes, found = boxes_of(folder, **options)
    assert found == faults
    assert {name: len(each) for name, each in boxes.items()} == counts


# Truncated files: of images, and of annotations.


def test_yolo_files_cut_short(tmp_path):
    write_yolo(tmp_path, {**GOOD, "a": [BALL], "b": [GOAL, BALL], "c": [BALL]})
    cut(tmp_path / "a.jpg")
    text = (tmp_path / "b.txt").read_text()
    (tmp_path / "b.txt").write_text(text.rstrip().rpartition(" ")[0])
    (tmp_path / "c.txt").write_bytes(b"0 0.5 \xff\xfe 0.1")
    (tmp_path / "d.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    write_image(tmp_path / "e.jpg")
    check(
        tmp_path,
        [
            f"b.txt line 2: {text.splitlines()[1].rpartition(' ')[0]!r} has 4 values; allowed: class x y width height, "
            "and perhaps a confidence; or class and three or more corners x y; b.jpg not used",
            f"can't read {tmp_path}/c.txt: it is not UTF-8 text; c.jpg not used",
            "d.txt: there is no image for it",
            "a.jpg: is cut short; not used",
            "e.jpg: no annotation names it; an image that shows nothing needs an empty one; not used",
        ],
        GOOD_COUNTS,
    )


def test_voc_files_cut_short(tmp_path):
    write_voc(tmp_path, {**GOOD, "a": [BALL], "b": [GOAL, BALL], "c": [BALL]}, beside=False)
    texts, images = tmp_path / "Annotations", tmp_path / "JPEGImages"
    cut(images / "a.jpg")
    cut(texts / "b.xml")
    cut(texts / "c.xml", 0.0)
    (texts / "d.xml").write_text(voc_text("d.jpg", [BALL]))
    (texts / "e.xml").write_text(voc_text("e.jpg", []).replace("<filename>e.jpg</filename>", ""))
    boxes, faults = boxes_of(tmp_path)
    assert {name: len(each) for name, each in boxes.items()} == {"good1": 1, "good2": 2, "good3": 0}
    assert faults[0].startswith("Annotations/b.xml: is cut short or not XML (")
    assert faults[0].endswith("); JPEGImages/b.jpg not used")
    assert faults[1:] == [
        "Annotations/c.xml: is cut short or not XML (no element found: line 1, column 0); JPEGImages/c.jpg not used",
        "Annotations/d.xml: there is no image 'd.jpg'",
        "Annotations/e.xml: there is no image for it",
        "JPEGImages/a.jpg: is cut short; not used",
    ]


def test_coco_files_cut_short(tmp_path):
    write_coco(tmp_path, {**GOOD, "a": [BALL]}, beside=False)
    cut(tmp_path / "images" / "a.jpg")
    write_image(tmp_path / "images" / "other.jpg")
    more = tmp_path / "annotations" / "more.json"
    more.write_text(json.dumps(coco_table({"other": [BALL]})))
    cut(more)
    boxes, faults = boxes_of(tmp_path)
    assert {name: len(each) for name, each in boxes.items()} == {"good1": 1, "good2": 2, "good3": 0}
    assert len(faults) == 2
    assert faults[0].startswith("annotations/more.json: is cut short or not JSON (")
    assert faults[0].endswith("); file not used")
    assert faults[1] == "images/a.jpg: is cut short; not used"


# Wrong sizes: of images, and of boxes.


def test_yolo_boxes_of_wrong_sizes(tmp_path):
    lines = [
        "0 0.5 0.5 0.1 0.1",
        "0 0.5 0.5 0 0.1",
        "0 0.5 0.5 -0.1 0.1",
        "0 0.5 0.5 nan 0.1",
        "0 0.5 0.5 0.1 0.1",
        "0 80 60 20 20",
        "0 0.3 0.2 0.4 0.1",
        "0 0.2 x 0.4 0.1",
    ]
    checked = ["0 0.5 0.5 0.1 0.1", "0 0.98 0.5 0.1 0.1", "0 0.5001 0.5 0.1 0.1", "0 0.3 0.2 0.4 0.1"]
    write_yolo(tmp_path, {**GOOD, "a": [BALL], "b": [BALL], "c": [BALL]})
    (tmp_path / "a.txt").write_text("\n".join(lines))
    (tmp_path / "b.txt").write_text("\n".join(checked))
    (tmp_path / "c.txt").write_text("\n".join([checked[0], *checked[2:]]))
    check(
        tmp_path,
        [
            "a.txt line 2: width 0 must be above 0; a.jpg not used",
            "a.txt line 3: width -0.1 must be above 0; a.jpg not used",
            "a.txt line 4: width 'nan' is not a finite number; a.jpg not used",
            "a.txt line 6: the box reaches from 70 to 90 in x; allowed: shares of the image from 0 to 1, and at most "
            "0.1 outside; a.jpg not used",
            "a.txt line 8: y 'x' is not a finite number; a.jpg not used",
            "b.txt line 3: the same box of ball as line 1; box not used",
            "b.txt line 4: ball of 64 x 12 px, but width and height of a ball in full view differ by a factor of 2 at "
            "most; is it partly hidden? box kept",
            "b.txt line 2: left, top, right, bottom 148.8, 54.0, 164.8, 66.0 px is outside of the image of 160 x 120 "
            "px; b.jpg not used",
            "c.txt line 2: the same box of ball as line 1; box not used",
            "c.txt line 3: ball of 64 x 12 px, but width and height of a ball in full view differ by a factor of 2 at "
            "most; is it partly hidden? box kept",
        ],
        {"c": 2, **GOOD_COUNTS},
    )


def test_voc_images_and_boxes_of_wrong_sizes(tmp_path):
    write_voc(tmp_path, {**GOOD, "a": [BALL], "b": [BALL], "c": [BALL], "d": [BALL], "e": [BALL], "f": [BALL]})
    (tmp_path / "a.xml").write_text(voc_text("a.jpg", [BALL], (120, 160)))
    (tmp_path / "b.xml").write_text(voc_text("b.jpg", [BALL], (640, 480)))
    (tmp_path / "c.xml").write_text(voc_text("c.jpg", [("ball", 40.0, 30.0, 20.0, 50.0), BALL]))
    (tmp_path / "d.xml").write_text(voc_text("d.jpg", [BALL, BALL], None))
    (tmp_path / "e.xml").write_text(voc_text("e.jpg", [BALL], ("wide", 120)))
    (tmp_path / "f.xml").write_text(voc_text("f.jpg", [("ball", 30.0, 40.0, 50.0, 1e999)]))
    check(
        tmp_path,
        [
            "e.xml: size wide x 120 is not a width and a height in pixels; e.jpg not used",
            "a.jpg: a.xml states a size of 120 x 160 px, but the image has 160 x 120 px; not used",
            "b.jpg: b.xml states a size of 640 x 480 px, but the image has 160 x 120 px; not used",
            "c.xml object 1: size -20 x 20 px; width and height must be above 0; c.jpg not used",
            "d.xml object 2: the same box of ball as object 1; box not used",
            "f.xml object 1: edges must be finite numbers, not 30, 40, 50, inf; f.jpg not used",
        ],
        {"d": 1, **GOOD_COUNTS},
    )


def test_long_coco_ids_that_begin_alike_are_different(tmp_path):
    write_coco(tmp_path, {"a": [BALL], "b": [BALL, GOAL]})
    path = tmp_path / "instances.json"
    table = json.loads(path.read_text())
    for name, key in (("images", "id"), ("annotations", "image_id")):
        for entry in table[name]:
            entry[key] = f"{'a long path/' * 8}{entry[key]}"
    path.write_text(json.dumps(table))
    check(tmp_path, [], {"a": 1, "b": 2})


def test_coco_images_and_boxes_of_wrong_sizes(tmp_path):
    write_coco(tmp_path, {**GOOD, "a": [BALL], "b": [BALL] * 6, "c": [BALL], "d": [BALL], "e": []})
    path = tmp_path / "instances.json"
    table = json.loads(path.read_text())
    images = {each["file_name"]: each for each in table["images"]}
    images["a.jpg"]["width"] = 320
    images["c.jpg"]["height"] = "120"
    del images["d.jpg"]["width"]
    bad = [each for each in table["annotations"] if each["image_id"] == images["b.jpg"]["id"]]
    wrong = ([20, 30, 0, 20], [20, 30, math.nan, 20], [20, 30, 20], [20, "30", 20, 20], [-30, 30, 40, 20])
    for entry, bbox in zip(bad, wrong, strict=False):
        entry["bbox"] = bbox
    for at in (0, 1, 4):
        bad[at]["image_id"] = images["e.jpg"]["id"]
    later = (
        (0, "size 0 x 20 px; width and height must be above 0"),
        (1, "edges must be finite numbers, not 20, 30, nan, 50"),
        (4, "left, top, right, bottom -30.0, 30.0, 10.0, 50.0 px is outside of the image of 160 x 120 px"),
    )
    path.write_text(json.dumps(table))
    first = bad[0]["id"]
    check(
        tmp_path,
        [
            'instances.json image 15: size 160 x "120" is not a width and a height in pixels; c.jpg not used',
            f"instances.json annotation {first + 2}: bbox [20, 30, 20] is not a list of left, top, width and height; "
            "b.jpg not used",
            f'instances.json annotation {first + 3}: "30" is not a number; b.jpg not used',
            "a.jpg: instances.json states a size of 320 x 120 px, but the image has 160 x 120 px; not used",
            *(f"instances.json annotation {first + at}: {fault}; e.jpg not used" for at, fault in later),
        ],
        {"d": 1, **GOOD_COUNTS},
    )


def test_a_box_that_reaches_out_slightly_is_clipped(tmp_path):
    write_yolo(tmp_path, {"a": [BALL], **GOOD})
    (tmp_path / "a.txt").write_text("0 0.05 0.5 0.12 0.1\n1 0.9 0.55 0.22 1.1\n")
    boxes, faults = boxes_of(tmp_path)
    assert faults == []
    ball, goal = boxes["a"]
    assert (ball.left, round(ball.right, 6)) == (-0.5, 17.1)
    assert (round(goal.left, 6), goal.top, goal.right, goal.bottom) == (125.9, -0.5, 159.5, 119.5)


# Unknown classes, and two images with one name.


def test_yolo_classes_unknown_and_images_of_one_name(tmp_path):
    write_yolo(tmp_path, {**GOOD, "a": [BALL], "b": [BALL], "z": [BALL]})
    (tmp_path / "a.txt").write_text("7 0.5 0.5 0.1 0.1\nball 0.5 0.5 0.1 0.1\n-1 0.5 0.5 0.1 0.1\n1 0.2 0.2 0.1 0.1\n")
    write_image(tmp_path / "b.png")
    (tmp_path / "z.jpg").write_bytes((tmp_path / "good1.jpg").read_bytes())
    check(
        tmp_path,
        [
            "a.txt line 1: class 7 is unknown; the table of names has 0 to 1: ball, goal; a.jpg not used",
            "a.txt line 2: class 'ball' is not a whole number from 0 up; a.jpg not used",
            "a.txt line 3: class '-1' is not a whole number from 0 up; a.jpg not used",
            "b.jpg and b.png: two images with one name; b.txt may belong to either; not used",
            "z.jpg: the same image as good1.jpg; not used",
        ],
        GOOD_COUNTS,
    )


def test_voc_classes_unknown_and_images_of_one_name(tmp_path):
    write_voc(
        tmp_path, {**GOOD, "a": [BALL, GOAL, ("goal", 50.0, 10.0, 60.0, 90.0)], "b": [BALL], "c": [BALL], "d": [BALL]}
    )
    text = (tmp_path / "a.xml").read_text().replace("<name>ball</name>", "<name> </name>")
    (tmp_path / "a.xml").write_text(text.replace("<xmin>50.0", "<xmin>5O").replace("bndbox", "circle", 4))
    (tmp_path / "b.xml").write_text(voc_text("b", [BALL]))
    write_image(tmp_path / "b.png")
    write_image(tmp_path / "c.png")
    (tmp_path / "d2.xml").write_text(voc_text("d.jpg", [GOAL]))
    (tmp_path / "e.xml").write_text(
        '<!DOCTYPE a [<!ENTITY b "ball">]>\n<annotation><filename>e.jpg</filename></annotation>'
    )
    (tmp_path / "f.xml").write_text("<html><annotation/></html>")
    check(
        tmp_path,
        [
            "a.xml object 1: class unknown: <name> is missing or empty; a.jpg not used",
            "a.xml object 2: goal: there is no <bndbox> with xmin, ymin, xmax, ymax, <robndbox> or <polygon>; a.jpg "
            "not used",
            "a.xml object 3: goal: xmin '5O' is not a number; a.jpg not used",
            "b.xml: may belong to b.jpg and b.png: two images with one name; b.jpg and b.png not used",
            "e.xml: has a DOCTYPE, which is not allowed",
            "f.xml: begins with <html>, not with <annotation>",
            "d.jpg: annotated by d.xml and by d2.xml; not used",
            "c.png: no annotation names it; an image that shows nothing needs an empty one; not used",
        ],
        {"c": 1, **GOOD_COUNTS},
    )


def test_coco_classes_unknown_and_images_of_one_name(tmp_path):
    write_coco(
        tmp_path, {**GOOD, "a": [BALL, BALL, GOAL], "b": [BALL], "c": [BALL], "d": [BALL], "e": []}, beside=False
    )
    path = tmp_path / "annotations" / "instances.json"
    table = json.loads(path.read_text())
    images = {each["file_name"]: each for each in table["images"]}
    first, second, third = (each for each in table["annotations"] if each["image_id"] == images["a.jpg"]["id"])
    first["category_id"], second["iscrowd"], third["image_id"] = 99, 1, 500
    write_image(tmp_path / "images" / "more" / "b.jpg")
    images["b.jpg"]["file_name"] = "old/b.jpg"
    images["d.jpg"]["file_name"] = "c.jpg"
    images["e.jpg"]["file_name"] = "none.jpg"
    path.write_text(json.dumps(table))
    label = "annotations/instances.json"
    unnamed = "no annotation names it; an image that shows nothing needs an empty one; not used"
    check(
        tmp_path,
        [
            f"{label} image 14: 'old/b.jpg' may be images/b.jpg and images/more/b.jpg: two images with one name; "
            "not used",
            f"{label} image 16: image 15 has the same name: two images with one name; images/c.jpg not used",
            f"{label} image 17: there is no image 'none.jpg'; not used",
            f"{label} annotation {first['id']}: category 99 is unknown; categories has 3 ball, 4 goal; "
            "images/a.jpg not used",
            f"{label} annotation {second['id']}: marks a crowd of ball, not a single one; images/a.jpg not used",
            f"{label} annotation {third['id']}: there is no image with id 500; box not used",
            *(f"images/{name}.jpg: {unnamed}" for name in ("d", "e")),
        ],
        GOOD_COUNTS,
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda table: table.pop("categories"), "lacks categories, a list of tables"),
        (lambda table: table.update(images={}), "lacks images, a list of tables"),
        (lambda table: table["categories"].append({"id": 3, "name": "cup"}), "category 3 has two names"),
        (lambda table: table["categories"].append({"id": 0.5, "name": "cup"}), "needs an id and a name"),
    ],
)
def test_coco_files_of_wrong_structure_are_named(change, said, tmp_path):
    write_coco(tmp_path, {"a": [BALL]})
    path = tmp_path / "instances.json"
    table = json.loads(path.read_text())
    change(table)
    path.write_text(json.dumps(table))
    (line,) = read_boxes(tmp_path).faults
    assert line.startswith("instances.json: ")
    assert said in line
