"""The same boxes in three formats, their layouts, names, recordings and lenses."""

import json
import re
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_embedded.output.box_files import overlap
from vm_train.boxes.box import Box
from vm_train.boxes.read import FORMATS, read_boxes

from .written import SIZE, WRITERS, write_coco, write_image, write_voc, write_yolo

BALL = ("ball", 20.0, 30.0, 40.0, 50.0)
GOAL = ("goal post", 100.5, 10.0, 110.0, 90.0)

LENS = "projection: RECTILINEAR\nfocal_length: 120.0\nfov: 1.5\n"


@st.composite
def boxes(draw):
    width, height = (draw(st.floats(4.0, 60.0)) for _ in range(2))
    left, top = draw(st.floats(0.0, SIZE[0] - width)), draw(st.floats(0.0, SIZE[1] - height))
    kind = draw(st.sampled_from(["robot", "goal post", "Mensch"]))
    return (kind, left, top, left + width, top + height)


def as_box(kind, left, top, right, bottom):
    return Box(kind, left - 0.5, top - 0.5, right - 0.5, bottom - 0.5)


def distinct(some):
    made = [as_box(*each) for each in some]
    return all(overlap(one.edges, other.edges) < 0.8 for at, one in enumerate(made) for other in made[:at])


pictures = st.dictionaries(
    st.from_regex(r"[a-z]{1,6}_[0-9]{3}", fullmatch=True), st.lists(boxes(), max_size=3).filter(distinct), min_size=1,
    max_size=3
).filter(lambda found: any(found.values()))  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("beside", [True, False], ids=["beside", "apart"])
@pytest.mark.parametrize("format", FORMATS)
@settings(max_examples=15)
@given(pictures=pictures)
def test_what_is_written_is_read_back(format, beside, pictures):
    with tempfile.TemporaryDirectory() as place:
        WRITERS[format](Path(place), pictures, beside)
        found = read_boxes(Path(place))
        assert found.faults == ()
        assert [each.image.stem for each in found.pictures] == sorted(pictures)
        assert found.names == tuple(sorted({box[0] for some in pictures.values() for box in some}))
        for each in found.pictures:
            assert each.size == SIZE
            assert each.recording == each.image.stem.rpartition("_")[0]
            expected = [as_box(*box) for box in pictures[each.image.stem]]
            assert [box.name for box in each.boxes] == [box.name for box in expected]
            for box, other in zip(each.boxes, expected, strict=True):
                edges = [(e.left, e.top, e.right, e.bottom) for e in (box, other)]
                np.testing.assert_allclose(*edges, rtol=0.0, atol=1e-9)
        assert read_boxes(Path(place), format) == found


def test_a_box_has_middle_and_size():
    box = as_box(*BALL)
    np.testing.assert_array_equal(box.center, [29.5, 39.5])
    assert (box.width, box.height) == (20.0, 20.0)


@pytest.mark.parametrize("format", FORMATS)
def test_names_are_mapped_and_a_name_that_no_box_has_is_told(format, tmp_path):
    WRITERS[format](tmp_path, {"a": [("football", *BALL[1:]), GOAL]})
    found = read_boxes(tmp_path, names={"football": "ball"})
    assert (found.names, found.faults) == (("ball", "goal post"), ())
    found = read_boxes(tmp_path, names={"fotball": "ball"})
    assert found.names == ("football", "goal post")
    assert found.faults == (
        "no box to rename to ball: unknown class 'fotball'; did you mean 'football'? (allowed: football, goal post)",
    )


def test_numbers_are_the_names_without_a_table(tmp_path):
    write_yolo(tmp_path, {"a": [BALL, GOAL]})
    (tmp_path / "classes.txt").unlink()
    assert read_boxes(tmp_path).names == ("0", "1")
    assert read_boxes(tmp_path, names={"0": "ball"}).names == ("1", "ball")


def test_an_unusable_table_of_names_is_named(tmp_path):
    write_yolo(tmp_path, {"a": [BALL]})
    (tmp_path / "obj.names").write_text("goal\n")
    with pytest.raises(InputError, match=r"classes.txt and .*obj.names name the classes differently"):
        read_boxes(tmp_path)


def test_the_folder_of_images_is_enough(tmp_path, monkeypatch):
    write_yolo(tmp_path, {"a": [BALL], "b": [GOAL]}, beside=False)
    monkeypatch.chdir(tmp_path / "images")
    (tmp_path / "labels" / "b.txt").write_text("2 0.5 0.5 0.1 0.1\n")
    found = read_boxes(Path())
    assert [(each.image, len(each.boxes)) for each in found.pictures] == [(Path("a.jpg"), 1)]
    assert found.names == ("ball",)
    assert found.faults == (
        "../labels/b.txt line 1: class 2 is unknown; the table of names has 0 to 1: ball, goal post; b.jpg not used",
    )


def test_a_confidence_is_no_fault(tmp_path):
    write_yolo(tmp_path, {"a": [BALL]})
    before = read_boxes(tmp_path)
    (tmp_path / "a.txt").write_text((tmp_path / "a.txt").read_text().rstrip() + " 0.73\n")
    assert read_boxes(tmp_path) == before


def test_folders_without_use_are_refused(tmp_path):
    with pytest.raises(InputError, match="there is no folder"):
        read_boxes(tmp_path / "none")
    (tmp_path / "boxes.json").write_text("{}")
    with pytest.raises(InputError, match="is a file: give the folder with the images"):
        read_boxes(tmp_path / "boxes.json")
    with pytest.raises(InputError, match="no images in"):
        read_boxes(tmp_path)
    write_image(tmp_path / "a.jpg")
    (tmp_path / "README.txt").write_text("About these images\n")
    (tmp_path / "settings.json").write_text("{}")
    with pytest.raises(InputError, match=r"no annotations in .*YOLO.*VOC.*COCO"):
        read_boxes(tmp_path)
    (tmp_path / "images").mkdir()
    (tmp_path / "annotations").mkdir()
    write_image(tmp_path / "images" / "b.jpg")
    with pytest.raises(InputError, match=rf"; for those in annotations beside it, give {re.escape(str(tmp_path))}$"):
        read_boxes(tmp_path / "images")
    (tmp_path / "images" / "b.jpg").unlink()
    with pytest.raises(InputError, match="unknown format 'yol'; did you mean 'yolo'"):
        read_boxes(tmp_path, "yol")
    write_yolo(tmp_path, {"a": [BALL]})
    write_voc(tmp_path, {"a": [GOAL]})
    with pytest.raises(InputError, match="several formats, yolo, voc: choose one with --format"):
        read_boxes(tmp_path)
    assert read_boxes(tmp_path, "voc").names == ("goal post",)
    with pytest.raises(InputError, match=r"no annotations in format coco in .*; it has yolo, voc"):
        read_boxes(tmp_path, "coco")


def test_sub_folders_are_recordings(tmp_path):
    write_yolo(tmp_path / "monday", {"f1": [BALL], "f2": []}, beside=False)
    write_yolo(tmp_path / "tuesday", {"g1": [BALL]}, beside=False)
    found = read_boxes(tmp_path)
    assert found.faults == ()
    assert [each.recording for each in found.pictures] == ["monday", "monday", "tuesday"]


def test_folders_of_annotation_tools_are_no_recordings(tmp_path):
    for part in ("train", "valid"):
        write_image(tmp_path / part / "images" / f"cam0_{part}_001.jpg")
        (tmp_path / part / "labels").mkdir()
        (tmp_path / part / "labels" / f"cam0_{part}_001.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    write_image(tmp_path / "images" / "val" / "cam1_002.jpg")
    (tmp_path / "labels" / "val").mkdir(parents=True)
    (tmp_path / "labels" / "val" / "cam1_002.txt").write_text("")
    found = read_boxes(tmp_path)
    assert found.faults == ()
    assert [each.recording for each in found.pictures] == ["cam1", "cam0_train", "cam0_valid"]


def test_coco_images_are_found_by_path_and_by_name(tmp_path):
    write_coco(tmp_path, {"a": [BALL], "b": [GOAL], "c": []}, beside=False)
    path = tmp_path / "annotations" / "instances.json"
    table = json.loads(path.read_text())
    for entry, name in zip(table["images"], ("images/a.jpg", "C:\\frames\\b.jpg", "/home/me/c.jpg"), strict=True):
        entry["file_name"] = name
    path.write_text(json.dumps(table))
    found = read_boxes(tmp_path)
    assert found.faults == ()
    assert [len(each.boxes) for each in found.pictures] == [1, 1, 0]


def test_a_voc_file_of_another_name_belongs_to_the_image_that_it_names(tmp_path):
    write_voc(tmp_path, {"a": [BALL], "b": []})
    (tmp_path / "a.xml").rename(tmp_path / "other.xml")
    found = read_boxes(tmp_path)
    assert (found.faults, [len(each.boxes) for each in found.pictures]) == ((), [1, 0])


def test_lenses_beside_images_are_found(tmp_path):
    write_yolo(tmp_path, {"a1": [BALL], "b1": [], "image3": [], "d": []})
    for name in ("a1.yaml", "lensb1.yaml", "lens3.yaml"):
        (tmp_path / name).write_text(LENS)
    found = read_boxes(tmp_path)
    assert found.faults == ()
    assert [each.lens and each.lens.name for each in found.pictures] == ["a1.yaml", "lensb1.yaml", None, "lens3.yaml"]
    (tmp_path / "a1.yaml").write_text("projection: RECTILINER\n")
    (tmp_path / "lens3.yaml").write_text(LENS + "size: [300, 300]\n")
    found = read_boxes(tmp_path)
    assert [each.lens is None for each in found.pictures] == [True, False, True, True]
    first, second = found.faults
    assert first.startswith("a1.yaml: ")
    assert first.endswith("; a1.jpg is used without lens")
    assert second.startswith("lens3.yaml: ")


@pytest.mark.long
def test_the_real_frames(shared):
    for part, frames, balls in (("train", 359, 366), ("test", 173, 130)):
        found = read_boxes(shared / "boxes" / part, names={"0": "ball", "1": "robot"})
        assert len(found.pictures) == frames
        assert Counter(box.name for each in found.pictures for box in each.boxes)["ball"] == balls
        assert {each.size for each in found.pictures} == {(608, 800)}
        assert found.faults == ()
        assert all("partly hidden" in line for line in found.remarks)
        named = {each.image.name: each.recording for each in found.pictures}
        if part == "train":
            assert named["20230709_r5_cam0_20230709_104538.jpg"] == "20230709_r5_cam0"
