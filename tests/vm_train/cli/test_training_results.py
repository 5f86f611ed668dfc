"""Networks that vm-train trains on special data, and their scores."""

import json
import shutil
from pathlib import Path

import cv2
import pytest

from tests.vm_train.commands import SMALL, run, run_module
from tests.vm_train.drawn import CLASSES, draw_set
from vm_export.checkpoint import Checkpoint
from vm_train.runs.log import read_log

VALIDATION = "validation_average_precision"


@pytest.mark.long
def test_a_validation_without_objects_chooses_by_all_classes(data, configuration, tmp_path):
    without = [each for each in range(30) if json.loads((data / f"scene{each:04d}.json").read_text())["ball"] is None]
    assert without
    (tmp_path / "validation.txt").write_text("\n".join(f"{each:04d}" for each in without))
    done = run(data, "-o", tmp_path / "run", "--config", configuration, "--validation", tmp_path / "validation.txt")
    assert "the validation pictures show no ball: the validation AP is the mean of all classes" in done.stderr
    scores = [record[VALIDATION] for _, record in read_log(tmp_path / "run" / "log.jsonl") if VALIDATION in record]
    assert min(scores) > 0.0


@pytest.mark.long
def test_a_rare_class_does_not_leave_the_training_without_points(data, configuration, tmp_path):
    folder = Path(shutil.copytree(data, tmp_path / "data"))
    mask = cv2.imread(str(folder / "mask0002.png"), cv2.IMREAD_UNCHANGED)
    mask[100:110, 40:50] = (0, 255, 255, 255)
    cv2.imwrite(str(folder / "mask0002.png"), mask)
    path = tmp_path / "train.toml"
    path.write_text(CLASSES + 'goal = { kind = "upright", colors = [[255, 255, 0]] }\n' + SMALL)
    balanced = ["--set", "training.selection=balanced", "--set", "data.validation=0.2"]
    run(folder, "-o", tmp_path / "run", "--config", path, *balanced)
    records = [record for _, record in read_log(tmp_path / "run" / "log.jsonl")]
    assert min(each["points"] for each in records if "points" in each) > 30


@pytest.mark.long
def test_an_evaluation_knows_the_colors_of_its_training(data, tmp_path):
    folder = Path(shutil.copytree(data, tmp_path / "data"))
    for path in folder.glob("mask*.png"):
        mask = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        mask[(mask == (0, 0, 255, 255)).all(axis=2)] = (10, 20, 30, 255)
        cv2.imwrite(str(path), mask)
    (tmp_path / "train.toml").write_text(CLASSES.replace("[[255, 0, 0]]", "[[30, 20, 10]]") + SMALL)
    once = ["--set", "training.epochs=1", "--set", "training.selection=balanced"]
    run(folder, "-o", tmp_path / "run", "--config", tmp_path / "train.toml", *once)
    model, split = tmp_path / "run" / "model.pt", tmp_path / "run" / "pictures.json"
    run_module("vm_train.cli.evaluate", model, folder, "--list", split, "-o", tmp_path / "report")
    part = run_module("vm_train.cli.evaluate", model, folder, "--part", "test", "-o", tmp_path / "none", code=1)
    assert "give it with --list" in part.stderr


@pytest.mark.long
def test_a_hexagonal_network_trains_and_is_not_exported(data, configuration, tmp_path):
    folder = tmp_path / "run"
    hexagonal = ["--set", "mesh.grid=hexagonal", "--set", "mesh.equal_at=1.5", "--set", "training.selection=balanced"]
    run(data, "-o", folder, "--config", configuration, *hexagonal)
    assert Checkpoint.load(folder / "model.pt").grid.equal_at == 1.5
    done = run_module("vm_export.cli", folder / "model.pt", code=1)
    assert "was trained on a hexagonal grid; the runtime has only the Visual Mesh" in done.stderr
    assert not Path(folder / "model.onnx").exists()


@pytest.mark.long
def test_a_small_network_learns_to_find_the_balls_of_pictures_it_has_not_seen(configuration, tmp_path):
    """Five layers of four channels, as in benchmarks/experiments/training.md."""
    data = draw_set(tmp_path / "data", 160, seed=4, size=(320, 256))
    settings = ["mesh.max_distance=5", "network.depth=5", "training.selection=balanced", "training.epochs=25"]
    settings += ["training.rate=0.02", "data.test=0.25"]
    overrides = [each for entry in settings for each in ("--set", entry)]
    run(data, "-o", tmp_path / "run", "--config", configuration, *overrides)
    model, split = tmp_path / "run" / "model.pt", tmp_path / "run" / "pictures.json"
    run_module("vm_train.cli.evaluate", model, data, "--list", split, "-o", tmp_path / "report")
    found = json.loads((tmp_path / "report" / "scores.json").read_text())["objects"]["ball"]
    whole = found["iou_0.5"]["all"]
    assert whole["truths"] >= 20
    assert whole["recall"] > 0.9
    assert whole["false_per_picture"] < 0.5
