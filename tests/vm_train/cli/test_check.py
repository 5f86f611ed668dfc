"""vm-train check: all faults at once, what good pictures show, and the exit status."""

import json
import math

import cv2
import numpy as np
import pytest

from vm_embedded.errors import VisualMeshError
from vm_train.cli.check import as_json, check_parser, complaints, run_check, tables
from vm_train.data.classes import Classes
from vm_train.data.inspection import inspect_pictures
from vm_train.data.pictures import find_pictures

from ..data.test_pictures import CLASSES, FAULTS, LOOKING_DOWN, write_pictures


@pytest.fixture
def folder(tmp_path):
    write_pictures(tmp_path)
    return tmp_path


def checked(folder, classes=CLASSES, workers=1, objects=()):
    return inspect_pictures(find_pictures(folder), classes, workers, lambda: None, objects)


def run(folder, *options, classes=CLASSES):
    return run_check(check_parser().parse_args([str(folder), "--workers", "1", *options]), classes, ("ball",))


def test_what_good_pictures_show_is_counted(folder):
    found = checked(folder)
    assert [each.number for each in found.good] == ["0000001", "0000002"]
    assert found.pixels == {"ball": 2 * 400, "field": 2 * (160 * 70 - 400), "environment": 2 * 160 * 40}
    assert found.shown == {"ball": 2, "field": 2, "environment": 2}
    assert found.sizes == {(160, 120): 2}
    assert found.lenses == {"equisolid": 2}
    assert found.absent == []
    assert found.facts[0].unlabeled == 1600
    assert math.isclose(found.facts[0].height, LOOKING_DOWN.height)
    assert math.isclose(found.facts[0].pitch, 0.5)
    assert complaints(found, verbose=False) == []


@pytest.mark.parametrize(("kind", "said", "damage"), FAULTS.values(), ids=FAULTS)
def test_each_fault_is_told_and_the_others_are_good(kind, said, damage, folder):
    damage(folder)
    found = checked(folder)
    assert [each.number for each in found.good] == ["0000002"]
    assert [(each.number, each.kind) for each in found.faults] == [("0000001", kind)]
    (line,) = complaints(found, verbose=False)
    assert said in line


def test_each_kind_of_fault_has_one_line_and_a_count(tmp_path):
    write_pictures(tmp_path, [f"{index:02d}" for index in range(27)])
    for index in range(25):
        (tmp_path / f"mask{index:02d}.png").unlink()
    (tmp_path / "lens25.yaml").write_text("")
    found = checked(tmp_path)
    missing, lens, more = complaints(found, verbose=False)
    assert missing.startswith("25 pictures lack a file; the first: mask00.png: ")
    assert lens.startswith("lens25.yaml: ")
    assert more == "vm-train check --verbose lists all"
    assert complaints(found, verbose=True) == [each.text for each in found.faults]
    assert len(as_json(found)["faults"]) == 26


def test_distances_are_those_of_the_plane_below(tmp_path):
    write_pictures(tmp_path, ["1"])
    (lone,) = checked(tmp_path, objects=["ball"]).facts
    (distance,) = lone.distances
    # The ball's middle is 10 px, 0.11 rad, below the middle of the picture, which is 0.5 rad below the horizon.
    assert math.isclose(distance, LOOKING_DOWN.height / math.tan(0.5 + 10 / 90.0), rel_tol=0.02)
    with pytest.raises(VisualMeshError, match="did you mean 'ball'"):
        checked(tmp_path, objects=["bal"])


def test_things_above_the_horizon_have_no_distance(tmp_path):
    write_pictures(tmp_path, ["1"])
    mask = cv2.imread(str(tmp_path / "mask1.png"), cv2.IMREAD_UNCHANGED)
    mask[:5, :5] = (0, 0, 255, 255)
    cv2.imwrite(str(tmp_path / "mask1.png"), mask)
    found = checked(tmp_path, objects=["ball"])
    assert sum(map(math.isinf, found.facts[0].distances)) == 1
    assert as_json(found)["distances"]["no plane"] == 1


def test_worker_processes_find_the_same(tmp_path):
    write_pictures(tmp_path, [f"{index:02d}" for index in range(20)])
    (tmp_path / "mask07.png").unlink()
    done = []
    found = inspect_pictures(find_pictures(tmp_path), CLASSES, 2, lambda: done.append(1))
    assert len(done) == 20
    assert found == checked(tmp_path)


def test_the_report_and_the_exit_status(folder, capsys):
    assert run(folder, "--json", str(folder / "found.json")) == 0
    said = capsys.readouterr()
    assert "2 pictures, 0 of them can't be used" in said.out
    assert "160 x 120 px 2 (100.0 %)" in said.out
    assert "camera height [m]" in said.out
    assert said.err == ""
    assert json.loads((folder / "found.json").read_text())["good"] == 2
    (folder / "mask0000001.png").unlink()
    assert run(folder) == 1
    assert "vm-train: mask0000001.png: is missing" in capsys.readouterr().err


def test_a_class_that_never_occurs_is_told_and_strictly_a_fault(folder, capsys):
    classes = Classes({**CLASSES.colors, "robot": ((0, 0, 255),)})
    assert checked(folder, classes).absent == ["robot"]
    assert run(folder, classes=classes) == 0
    assert "no picture shows class robot" in capsys.readouterr().err
    assert run(folder, "--strict", classes=classes) == 1


def test_a_set_without_a_good_picture_has_a_report_too(folder):
    for path in folder.glob("mask*"):
        path.unlink()
    found = checked(folder)
    assert list(tables(found)) == ["2 pictures, 2 of them can't be used"]
    assert found.absent == []
    json.dumps(as_json(found), allow_nan=False)


def test_lenses_of_calibrations_have_no_orientation(folder):
    matrix = np.array([[90.0, 0.0, 80.0], [0.0, 90.0, 60.0], [0.0, 0.0, 1.0]]).tolist()
    (folder / "lens0000001.yaml").write_text(f"camera_matrix: {matrix}\ndistortion_model: fisheye\n")
    assert "lacks Hoc" in checked(folder).faults[0].text
