"""vm-train check --boxes, as a user types it."""

import json
import re
import shutil

import cv2
import pytest

from tests.rooms import CHECKOUT
from vm_embedded.errors import InputError
from vm_train.boxes.read import read_boxes
from vm_train.boxes.summary import name_faults
from vm_train.cli.box_options import parse_names

from ..boxes.written import WRITERS, write_voc, write_yolo
from ..commands import run, run_module

PICTURES = {
    "cam0_0001": [("fußball", 20.0, 30.0, 40.0, 50.0), ("robot", 100.0, 10.0, 110.0, 90.0)],
    "cam0_0002": [("fußball", 50.0, 30.0, 74.0, 52.0)],
    "cam1_0001": [],
}


@pytest.mark.parametrize("format", WRITERS)
def test_good_boxes_are_counted(format, tmp_path):
    folder, sheet, file = tmp_path / "frames", tmp_path / "sheet.jpg", tmp_path / "found.json"
    WRITERS[format](folder, PICTURES)
    done = run("check", folder, "--boxes", "--names", "fußball=ball", "--sheet", sheet, "--json", file)
    assert done.stderr == ""
    assert done.stdout.splitlines() == [
        "3 pictures can be used, of 2 recordings; 0 faults",
        "size   160 x 120 px 3",
        "pictures of a recording: 1 to 2, median 1.5",
        "with a lens file: 0",
        "without boxes: 1",
        "",
        "class  boxes  pictures                 width [px]                height [px]",
        "ball       2         2  20.0 to 24.0, median 22.0  20.0 to 22.0, median 21.0",
        "robot      1         1  10.0 to 10.0, median 10.0  80.0 to 80.0, median 80.0",
        f"{sheet}: 2 of 2 boxes of ball",
    ]
    assert cv2.imread(str(sheet)).shape[2] == 3
    found = json.loads(file.read_text())
    assert (found["pictures"], found["faults"], found["sizes"]) == (3, [], {"160x120": 3})
    assert found["recordings"] == {"cam0": 2, "cam1": 1}
    assert found["classes"]["ball"]["boxes"] == 2
    limited = run(
        "check", folder, "--boxes", "--format", format, "--names", "fußball=ball", "--sheet", sheet, "--count", 1
    )
    assert limited.stdout.splitlines()[-1] == f"{sheet}: 1 of 2 boxes of ball"


def test_faults_are_told_and_the_rest_is_counted(tmp_path):
    write_yolo(tmp_path, {**PICTURES, "bad": []})
    (tmp_path / "bad.txt").write_text("0 0.5 0.5 0.1\n" * 45)
    done = run("check", tmp_path, "--boxes", code=1)
    lines = done.stderr.splitlines()
    assert lines[0] == (
        "vm-train: bad.txt line 1: '0 0.5 0.5 0.1' has 4 values; allowed: class x y width height, and perhaps a "
        "confidence; or class and three or more corners x y; bad.jpg not used"
    )
    assert len(lines) == 41
    assert lines[-1] == "vm-train: and 6 more; vm-train check --boxes --json FILE lists all"
    assert done.stdout.startswith("3 pictures can be used, of 2 recordings; 45 faults\n")


def test_misspelled_and_missing_classes_are_told(tmp_path):
    write_voc(tmp_path, {"a1": [("Bal", 20.0, 30.0, 40.0, 50.0)], "a2": [("robot", 20.0, 30.0, 40.0, 50.0)]})
    found = read_boxes(tmp_path)
    misspelled, missing = name_faults(found, ["ball"])
    assert misspelled == (
        "class 'Bal' (1 box, the first in a1.jpg): did you mean 'ball'? Rename it with --names 'Bal=ball'"
    )
    assert missing == (
        "no box of class ball, which the network finds (classes: Bal, robot): rename one with --names NAME=ball"
    )
    assert name_faults(read_boxes(tmp_path, names={"Bal": "ball"}), ["ball"]) == []


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--boxes", "--config", "x.toml"], "--config is not for folders of boxes: leave it out"),
        (["--names", "0=ball"], "--names needs --boxes"),
        (["--sheet", "x.jpg"], "--sheet needs --boxes"),
        (["--boxes", "--names", "ball"], "--names 'ball' must be OLD=NEW, for example 0=ball"),
        (["--boxes", "--network", "bal"], "unknown network 'bal'; did you mean 'ball'?"),
        (["--boxes", "--sheet", "x.bmp"], "can't write x.bmp: the file of a contact sheet must be a .jpg or a .png"),
        (["--boxes", "--sheet", "x.jpg"], "can't draw x.jpg: there is no box of class ball"),
        (["--boxes", "--format", "coco"], "no annotations in format coco in "),
    ],
)
def test_wrong_use_is_explained(options, said, tmp_path):
    write_yolo(tmp_path, PICTURES)
    done = run("check", tmp_path, *options, code=1)
    assert said in done.stderr


def test_names_are_pairs():
    assert parse_names(["0=ball", "a=b=ball", "0=ball"]) == {"0": "ball", "a=b": "ball"}
    with pytest.raises(InputError, match="renames '0' to both 'ball' and 'cup'"):
        parse_names(["0=ball", "0=cup"])


@pytest.mark.long
def test_a_clear_ball_without_a_box_is_told(tmp_path):
    """Pictures of the demo with boxes of what the detector found, except one. In picture 9, a ball lies on a table."""
    saved, demo = tmp_path / "saved", tmp_path / "demo"
    shutil.copytree(CHECKOUT / "tests" / "fixtures" / "demo", demo, ignore=shutil.ignore_patterns("*0000009*"))
    run_module("vm_embedded.cli.detect", "--camera", demo, "--save-boxes", saved)
    clearest = max(
        (line for line in map(json.loads, (saved / "candidates.jsonl").read_text().splitlines()) if line["found"]),
        key=lambda line: line["confidence"],
    )
    start = f"vm-train: {clearest['image']}: without a box, but looks like a ball: "
    assert run("check", saved, "--boxes").stderr == ""
    (saved / clearest["image"]).with_suffix(".txt").write_text("")
    sheet = tmp_path / "sheet.jpg"
    done = run("check", saved, "--boxes", "--sheet", sheet, code=1)
    *_, told, advice = done.stderr.splitlines()
    assert told.startswith(start)
    assert done.stderr.count(start) == 1
    assert re.search(r"\(probability 0\.9\d+\)$", told)
    assert advice == (
        f"vm-train: 1 place looks like an object without a box; {sheet} shows them in red; only real objects need one, "
        "lamps do not"
    )
    assert done.stdout.endswith("; 1 of 1 places without a box, in red\n")
    assert run("check", saved, "--boxes", "--no-look").stderr == ""
