"""Folders as annotation tools export them are read without --format."""

import json

import pytest

from tests.programs import run_program
from vm_train.boxes.read import read_boxes

from .written import boxes_of, coco_table, voc_text, write_image, write_yolo

BALL = ("ball", 20.0, 30.0, 40.0, 50.0)
LINE = "0 0.1875 0.333333 0.125 0.166667\n"
README = "\nFrames - v1 2024-01-01 10:00am\n====\n\nThis dataset was exported via a tool.\n"
ROBOFLOW = ("cam0_0001_jpg.rf.0a1b2c3d", "cam0_0002_jpg.rf.1a1b2c3d")


def roboflow(folder, part="train"):
    (folder / part).mkdir(parents=True)
    (folder / "README.roboflow.txt").write_text(README)
    (folder / "README.dataset.txt").write_text("# Frames > 2024-01-01\nhttps://example.org\n")


def roboflow_yolo(folder):
    roboflow(folder)
    for name in ROBOFLOW:
        write_image(folder / "train/images" / f"{name}.jpg")
    (folder / "train/labels").mkdir()
    (folder / "train/labels" / f"{ROBOFLOW[0]}.txt").write_text(LINE.rstrip())
    (folder / "train/labels" / f"{ROBOFLOW[1]}.txt").write_text("")
    (folder / "data.yaml").write_text(
        "train: ../train/images\nval: ../valid/images\n\nnc: 1\nnames: ['ball']\n\nroboflow:\n  workspace: me\n"
    )


def roboflow_darknet(folder):
    roboflow(folder)
    for name, text in zip(ROBOFLOW, (LINE, ""), strict=True):
        write_image(folder / "train" / f"{name}.jpg")
        (folder / "train" / f"{name}.txt").write_text(text)
    (folder / "train/_darknet.labels").write_text("ball\n")


def roboflow_voc(folder):
    roboflow(folder)
    for name, boxes in zip(ROBOFLOW, ([BALL], []), strict=True):
        write_image(folder / "train" / f"{name}.jpg")
        (folder / "train" / f"{name}.xml").write_text(voc_text(f"{name}.jpg", boxes))


def roboflow_coco(folder):
    roboflow(folder)
    for name in ROBOFLOW:
        write_image(folder / "train" / f"{name}.jpg")
    table = coco_table(dict(zip(ROBOFLOW, ([BALL], []), strict=True)))
    table["categories"].insert(0, {"id": 0, "name": "balls", "supercategory": "none"})
    (folder / "train/_annotations.coco.json").write_text(json.dumps(table))


def cvat_yolo(folder):
    for name, text in (("frame_000000", LINE), ("frame_000001", "")):
        write_image(folder / "obj_train_data" / f"{name}.PNG")
        (folder / "obj_train_data" / f"{name}.txt").write_text(text)
    (folder / "obj.names").write_text("ball\n")
    (folder / "obj.data").write_text("classes = 1\ntrain = data/train.txt\nnames = data/obj.names\n")
    (folder / "train.txt").write_text("data/obj_train_data/frame_000000.PNG\ndata/obj_train_data/frame_000001.PNG\n")


def cvat_ultralytics(folder):
    for name, text in (("frame_000000", LINE), ("frame_000001", "")):
        write_image(folder / "images/train" / f"{name}.jpg")
        (folder / "labels/train").mkdir(parents=True, exist_ok=True)
        (folder / "labels/train" / f"{name}.txt").write_text(text)
    (folder / "data.yaml").write_text("names:\n  0: ball\npath: .\ntrain: train.txt\n")
    (folder / "train.txt").write_text("images/train/frame_000000.jpg\nimages/train/frame_000001.jpg\n")


def cvat_voc(folder):
    for part in ("Annotations", "ImageSets/Main"):
        (folder / part).mkdir(parents=True)
    for name, boxes in (("frame_000000", [BALL]), ("frame_000001", [])):
        write_image(folder / "JPEGImages" / f"{name}.jpg")
        (folder / "Annotations" / f"{name}.xml").write_text(voc_text(f"{name}.jpg", boxes))
    (folder / "ImageSets/Main/default.txt").write_text("frame_000000\nframe_000001\n")
    (folder / "labelmap.txt").write_text("# label:color_rgb:parts:actions\nball:250,50,83::\nbackground:0,0,0::\n")


def cvat_coco(folder):
    (folder / "annotations").mkdir(parents=True)
    for name in ("frame_000000", "frame_000001"):
        write_image(folder / "images/default" / f"{name}.jpg")
    table = coco_table({"frame_000000": [BALL], "frame_000001": []})
    for each in table["annotations"]:
        each |= {"segmentation": [], "area": 400.0, "iscrowd": 0, "attributes": {"occluded": False, "rotation": 0.0}}
    (folder / "annotations/instances_default.json").write_text(json.dumps({"licenses": [], "info": {}, **table}))


def label_studio_yolo(folder):
    write_yolo(folder, {"0a1b2c3d-frame": [BALL], "1a1b2c3d-frame": []}, beside=False)
    notes = {"categories": [{"id": 0, "name": "ball"}], "info": {"year": 2024, "contributor": "Label Studio"}}
    (folder / "notes.json").write_text(json.dumps(notes))


def label_studio_voc(folder):
    (folder / "Annotations").mkdir(parents=True)
    for name, boxes in (("0a1b2c3d-frame", [BALL]), ("1a1b2c3d-frame", [])):
        write_image(folder / "images" / f"{name}.jpg")
        (folder / "Annotations" / f"{name}.xml").write_text(voc_text(name, boxes))


def label_studio_coco(folder):
    names = ("0a1b2c3d-frame", "1a1b2c3d-frame")
    for name in names:
        write_image(folder / "images" / f"{name}.jpg")
    table = coco_table(dict(zip(names, ([BALL], []), strict=True)))
    for each in table["images"]:
        each["file_name"] = f"images\\{each['file_name']}"
    (folder / "result.json").write_text(json.dumps(table))


EXPORTS = (
    *(roboflow_yolo, roboflow_darknet, roboflow_voc, roboflow_coco),
    *(cvat_yolo, cvat_ultralytics, cvat_voc, cvat_coco),
    *(label_studio_yolo, label_studio_voc, label_studio_coco),
)


@pytest.mark.parametrize("first", ["\n", " \n\n0 zero\n"])
@pytest.mark.parametrize("export", EXPORTS)
def test_an_export_is_read_without_a_format_and_with_any_text_beside_it(export, first, tmp_path):
    folder = tmp_path / "export"
    export(folder)
    (folder / "notes.txt").write_text(first)
    boxes, faults = boxes_of(folder)
    assert faults == []
    assert sorted(map(len, boxes.values())) == [0, 1]
    assert [box.name for some in boxes.values() for box in some] == ["ball"]


def test_cvat_s_own_format_is_named(tmp_path):
    write_image(tmp_path / "images/a.jpg")
    (tmp_path / "annotations.xml").write_text('<annotations><image id="0" name="a.jpg"/></annotations>')
    faults = read_boxes(tmp_path).faults
    assert "CVAT" in faults[0]
    assert "annotations.xml" in faults[0]


def test_the_case(shared):
    folder = shared / "cases/boxes/roboflow-coco"
    if not folder.is_dir():
        pytest.skip("needs ../shared/cases")
    done = run_program("vm-train", "check", folder, "--boxes", "--no-look")
    assert "1 pictures can be used" in done.stdout
    (picture,) = read_boxes(folder).pictures
    assert [box.name for box in picture.boxes] == ["ball"]


def test_label_files_with_an_empty_first_line_are_read(tmp_path):
    write_yolo(tmp_path, {"a": [BALL]})
    (tmp_path / "a.txt").write_text(f"\n{LINE}")
    (tmp_path / "b.txt").write_text(f"\n\n{LINE}")
    boxes, faults = boxes_of(tmp_path)
    assert [len(each) for each in boxes.values()] == [1]
    assert faults == ["b.txt: there is no image for it"]
