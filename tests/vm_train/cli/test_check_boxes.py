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

from ..boxes.written import WRITERS, write_image, write_voc, write_yolo
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
    (tmp_path / "no image.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    command = ("check", tmp_path, "--boxes", "--no-look", "--names", "fußball=ball")
    done = run(*command, code=1)
    grouped, single, more = done.stderr.splitlines()
    first = (
        "bad.txt line 1: '0 0.5 0.5 0.1' has 4 values; allowed: class x y width height, and perhaps a "
        "confidence; or class and three or more corners x y; bad.jpg not used"
    )
    assert grouped.startswith("vm-train: 45 ")
    assert grouped.endswith(first)
    assert single.startswith("vm-train: no image.txt: ")
    assert "--verbose" in more
    assert done.stdout.startswith("3 pictures can be used, of 2 recordings; 46 faults\n")
    every = run(*command, "--verbose", code=1).stderr.splitlines()
    assert (len(every), every[0], every[-1]) == (46, f"vm-train: {first}", single)


def test_remarks_are_no_faults(tmp_path):
    """Photos that a phone turned, and balls behind a goalpost: all boxes are used."""
    frames = {f"cam{number}_1": [("ball", 20.0, 30.0, 40.0, 50.0)] for number in range(5)}
    write_yolo(tmp_path, frames)
    for name in list(frames)[:3]:
        write_image(tmp_path / f"{name}.jpg", size=(120, 160), orientation=6)
    (tmp_path / "cam4_1.txt").write_text("0 0.5 0.5 0.1 0.5\n")
    found = tmp_path / "found.json"
    done = run("check", tmp_path, "--boxes", "--no-look", "--json", found)
    assert done.stdout.startswith("5 pictures can be used, of 5 recordings; 0 faults, 4 remarks\n")
    turned, hidden, more = done.stderr.splitlines()
    assert turned.startswith("vm-train: 3 ")
    assert "cam0_1.jpg" in turned
    assert "cam4_1.txt line 1" in hidden
    assert "--verbose" in more
    kept = json.loads(found.read_text())
    assert (kept["faults"], len(kept["remarks"])) == ([], 4)


def test_a_wrong_name_is_counted_and_a_fault(tmp_path):
    write_yolo(tmp_path, {"a1": [("Bal", 20.0, 30.0, 40.0, 50.0)], "a2": [("ball", 20.0, 30.0, 40.0, 50.0)]})
    done = run("check", tmp_path, "--boxes", "--no-look", code=1)
    assert done.stdout.startswith("2 pictures can be used, of 1 recordings; 1 fault\n")
    assert "Bal" in done.stderr


def test_misspelled_and_missing_classes_are_told(tmp_path):
    write_voc(tmp_path, {"a1": [("Bal", 20.0, 30.0, 40.0, 50.0)], "a2": [("robot", 20.0, 30.0, 40.0, 50.0)]})
    found = read_boxes(tmp_path)
    misspelled, missing = (each.text for each in name_faults(found, ["ball"]))
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
    done = run("check", saved, "--boxes", "--sheet", sheet)
    assert "; 0 faults, 1 remark\n" in done.stdout
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
