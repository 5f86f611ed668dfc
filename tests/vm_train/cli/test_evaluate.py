"""vm-evaluate as a user types it: real processes, real files, and what goes wrong with them."""

import csv
import json
import re
import signal
import subprocess
import time
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import cv2
import pytest

from tests.folders import contents
from tests.looks import look_contract
from tests.programs import BIN, heed_interrupts, run_program
from tests.vm_export.looks import look_checkpoint
from vm_embedded.network.bundled import model_path
from vm_export.change_model import change_look
from vm_export.checkpoint import Checkpoint
from vm_export.grid import Grid
from vm_train.cli.evaluate import main

from ...drawn_scenes import CHECKPOINT, IMAGES, MODEL
from ..drawn import draw_set

run = partial(run_program, "vm-evaluate")


def complaint(capsys, *arguments):
    """What vm-evaluate has to say of arguments that it can't use."""
    assert main([str(each) for each in arguments]) == 1
    said = capsys.readouterr().err.strip().splitlines()
    assert said[-1].startswith("vm-evaluate: ")
    return said[-1]


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return draw_set(tmp_path_factory.mktemp("drawn"), 8, seed=5)


@pytest.fixture(scope="module")
def evaluated(data, tmp_path_factory):
    """Folder that an evaluation wrote, and what it printed."""
    out = tmp_path_factory.mktemp("out") / "evaluation"
    return out, run(MODEL, data, "-o", out, "--workers", 2, "--radius-of", "scene")


def test_it_writes_a_summary_tables_plots_and_a_report(evaluated, data):
    out, done = evaluated
    assert "objects of class ball" in done.stdout
    assert "report.html" in done.stdout
    tables = {"scores.json", "points.csv", "point_curves.csv", "confusion.csv", "objects.csv", "object_curves.csv"}
    tables.add("calibration.csv")
    assert {path.name for path in out.iterdir()} == tables | {"report.html", "plots"}
    plots = {path.name for path in (out / "plots").iterdir()}
    assert {"points_on_object.svg", "confusion.svg"} < plots
    assert len(plots) == 8
    for each in (out / "plots").iterdir():
        assert ElementTree.parse(each).getroot().tag.endswith("svg")


def test_scores_say_what_was_evaluated_and_tables_hold_the_same_numbers(evaluated, data):
    out, _ = evaluated
    scores = json.loads((out / "scores.json").read_text())
    assert scores["about"]["model"]["file"] == "ball.onnx"
    assert len(scores["about"]["model"]["sha256"]) == 64
    assert (scores["pictures"], scores["pictures_with_scenes"], scores["skipped"]) == (8, 8, {})
    with (out / "points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 * 21
    for row in rows:
        expected = scores["points"][row["class"]][row["distance"]]
        assert [float(row[key]) if row[key] else None for key in expected] == list(expected.values())
    with (out / "objects.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["iou"] for row in rows] == ["0.5"] * 21 + ["0.75"] * 21
    expected = scores["objects"]["ball"]["iou_0.5"]["all"]
    assert float(rows[0]["recall"]) == expected["recall"]
    assert (rows[0]["truths"], rows[0]["error_count"]) == (str(expected["truths"]), str(expected["errors"]["count"]))
    with (out / "confusion.csv").open() as file:
        confusion = [[int(row[f"taken for {name}"]) for name in scores["points"]] for row in csv.DictReader(file)]
    assert confusion[:4] == scores["confusion"]["all"]


def test_calibration_counts_all_objects_that_the_scores_count(evaluated):
    out, done = evaluated
    scores = json.loads((out / "scores.json").read_text())
    found, at_half = scores["calibration"]["ball"], scores["objects"]["ball"]["iou_0.5"]["all"]
    assert (found["iou"], len(found["bins"])) == (0.5, 15)
    assert found["found"] == sum(each["count"] for each in found["bins"]) == at_half["hits"] + at_half["false"]
    with (out / "calibration.csv").open() as file:
        rows = list(csv.DictReader(file))
    for row, expected in zip(rows, found["bins"], strict=True):
        assert [float(row[key]) if row[key] else None for key in expected] == list(expected.values())
    assert "calibration error (ECE)" in done.stdout


@pytest.fixture(scope="module")
def looking(tmp_path_factory):
    """A model file with a close look of random weights."""
    path = tmp_path_factory.mktemp("looking") / "looking.onnx"
    change_look(model_path("ball"), path, look_checkpoint(seed=1))
    return path


@pytest.mark.long
def test_a_close_look_s_proposals_have_scores_of_their_own(capsys, looking, data, tmp_path):
    out = tmp_path / "out"
    options = ("--radius-of", "scene", "--min-confidence", 0)
    done = run(looking, data, "-o", out, "--workers", 2, *options)
    assert "proposals for class ball: " in done.stdout
    page = (out / "report.html").read_text()
    assert "<h2>Proposals for class ball</h2>" in page
    scores = json.loads((out / "scores.json").read_text())
    assert scores["about"]["model"]["close look at ball"].startswith("8 x 8 samples")
    found = scores["proposals"]["ball"]
    assert found["pictures"] == 8
    assert 0.0 < found["mean_count"] <= found["largest_count"] <= look_contract().max_proposals
    assert found["all"]["truths"] == scores["objects"]["ball"]["iou_0.5"]["all"]["truths"]
    with (out / "proposals.csv").open() as file:
        rows = {row["distance"]: row for row in csv.DictReader(file)}
    assert len(rows) == 1 + 20
    for place, row in rows.items():
        expected = found[place]
        assert [float(row[key]) if row[key] else None for key in expected] == list(expected.values())
    again = tmp_path / "again"
    assert main([str(each) for each in (looking, data, "-o", again, "--workers", 1, *options)]) == 0
    for name in ("scores.json", "proposals.csv", "report.html"):
        assert (out / name).read_bytes() == (again / name).read_bytes()
    assert "proposals for class ball" in capsys.readouterr().out
    assert main([str(MODEL), str(data), "-o", str(again), "--workers", "1"]) == 0
    assert "proposals for class" not in capsys.readouterr().out
    assert json.loads((again / "scores.json").read_text())["proposals"] == {}
    assert not list(again.rglob("proposals.*"))


@pytest.mark.long
def test_a_robot_s_proposals_have_scores_too(looking, data, tmp_path):
    assert main([str(each) for each in (looking, data, "-o", tmp_path, "--workers", 1, "--as-robot")]) == 0
    assert json.loads((tmp_path / "scores.json").read_text())["proposals"]["ball"]["pictures"] == 8


def test_the_report_needs_nothing_else(evaluated):
    page = (evaluated[0] / "report.html").read_text()
    assert all(each.startswith("data:image/") for each in re.findall(r'src="([^"]{20})', page))
    assert not re.search(r"<script|<link|@import|url\(|href", page)
    assert page.count("<img") >= 7
    assert "image00" in page


@pytest.mark.long
def test_the_same_run_gives_the_same_files(evaluated, data, tmp_path):
    out, _ = evaluated
    assert main([str(MODEL), str(data), "-o", str(tmp_path / "again"), "--workers", "1", "--radius-of", "scene"]) == 0
    for path in sorted(out.rglob("*.*")):
        assert path.read_bytes() == (tmp_path / "again" / path.relative_to(out)).read_bytes(), path.name


@pytest.mark.long
def test_a_hexagonal_checkpoint_has_points_only_and_leaves_no_old_objects(capsys, data, tmp_path):
    checkpoint = Checkpoint.load(CHECKPOINT)
    path, out = tmp_path / "hexagonal.pt", tmp_path / "out"
    Checkpoint(checkpoint.network, checkpoint.manifest, Grid("hexagonal")).save(path)
    (out / "plots").mkdir(parents=True)
    for stale in (out / "objects.csv", out / "plots" / "distance_error.svg", out / "mine.txt"):
        stale.write_text("")
    (out / "scores.json").write_text('{"about": {}}')
    numbers = numbers_in(tmp_path, "0001", "0004")
    assert main([str(path), str(data), "-o", str(out), "--list", str(numbers), "--workers", "1"]) == 0
    said = capsys.readouterr()
    assert "points only" in said.err
    assert "objects of class" not in said.out
    assert {each.stem for each in out.iterdir() if each.suffix == ".csv"} == {"points", "point_curves", "confusion"}
    assert (out / "mine.txt").exists()
    assert {each.stem for each in (out / "plots").iterdir()} == {
        *("confusion", "points_curves", "points_over_distance", "points_on_object"),
    }
    assert json.loads((out / "scores.json").read_text())["pictures"] == 2


def numbers_in(folder, *numbers):
    path = folder / "numbers.txt"
    path.write_text("\n".join(numbers))
    return path


@pytest.fixture
def bad(tmp_path):
    """A set with a picture without mask, a damaged one, and one with a color of no class."""
    folder = draw_set(tmp_path / "set", 3)
    (folder / "mask0000.png").unlink()
    (folder / "image0001.jpg").write_bytes(b"nothing")
    mask = cv2.imread(str(folder / "mask0002.png"), cv2.IMREAD_UNCHANGED)
    mask[:5, :5] = (255, 0, 0, 255)
    cv2.imwrite(str(folder / "mask0002.png"), mask)
    return folder


@pytest.mark.long
def test_the_networks_of_the_package_have_names(capsys, data, tmp_path):
    done = run("ball", data, "-o", tmp_path / "out", "--workers", 1)
    assert "objects of class ball" in done.stdout
    assert "unknown network 'bal'; did you mean 'ball'?" in complaint(capsys, "bal", data, "-o", tmp_path / "out")


def test_strange_colors_come_with_advice_and_a_strict_run_ends_at_the_first_bad_picture(capsys, bad, tmp_path):
    out = ("-o", tmp_path / "out", "--workers", 1)
    said = complaint(capsys, MODEL, bad, *out)
    assert "mask0002.png" in said
    assert "[0, 0, 255]" in said
    assert "--color" in said
    assert "mask0000.png" in complaint(capsys, MODEL, bad, *out, "--strict")


@pytest.mark.long
def test_bad_pictures_are_skipped_and_a_robot_s_configuration_counts_unless_an_option_says_otherwise(bad, tmp_path):
    (tmp_path / "vm.toml").write_text('[detector]\nthreshold = 0.6\nmin_inside = 0.6\nformat = "rgb"\n')
    robot = ("--as-robot", "--config", tmp_path / "vm.toml", "--min-inside", 0.5)
    done = run(MODEL, bad, "-o", tmp_path / "out", *robot, "--color", "environment=0,0,255")
    assert done.stderr.count("vm-evaluate: skipped") == 2
    assert "mask0000.png: is missing" in done.stderr
    assert "1 picture of" in done.stdout
    assert "2 skipped" in done.stdout
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    settings = scores["about"]["settings"]
    assert (settings["threshold"], settings["min_inside"], settings["format"]) == (0.6, 0.5, "bgr")
    assert scores["about"]["rules"]["as_robot"] is True
    assert scores["points"]["ball"]["all"]["threshold"] == 0.6
    assert "--radius-of scene" in scores["about"]["notes"][0]  # balls of 0.07 m, and the network's are larger


def test_what_can_t_be_used_is_named_in_one_line(capsys, data, tmp_path):
    out = ("-o", tmp_path / "out")
    folder = draw_set(tmp_path / "set", 1)
    (folder / "mask0000.png").unlink()
    assert "no picture could be evaluated" in complaint(capsys, MODEL, folder, *out)
    assert "imageX" in complaint(capsys, MODEL, tmp_path, *out)
    assert "no folder" in complaint(capsys, MODEL, tmp_path / "missing", *out)
    assert ".pt" in complaint(capsys, IMAGES[0], data, *out)
    assert "missing.onnx" in complaint(capsys, tmp_path / "missing.onnx", data, *out)
    assert "vm-export" in complaint(capsys, CHECKPOINT, data, *out, "--as-robot")
    assert "names no picture" in complaint(capsys, MODEL, data, *out, "--list", numbers_in(tmp_path))
    assert "did you mean 'ball'" in complaint(capsys, MODEL, data, *out, "--color", "bal=1,2,3")
    assert "--as-robot" in complaint(capsys, MODEL, data, *out, "--as-robot", "--radius-of", "scene")
    assert "bgr" in complaint(capsys, MODEL, data, *out, "--format", "rgb")
    (tmp_path / "file").write_text("")
    assert "not a folder" in complaint(capsys, MODEL, data, "-o", tmp_path / "file")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "arguments",
    [(), ("model.onnx",), ("model.onnx", "data"), ("m", "d", "-o", "x", "--color", "red"), ("points",)],
)
def test_wrong_usage_exits_with_2(arguments):
    assert "--help lists the options" in run(*arguments, code=2).stderr


def test_a_setting_out_of_range_is_wrong_usage():
    said = run("model.onnx", "data", "-o", "out", "--threshold", "7", code=2).stderr
    assert "argument --threshold: threshold must be a number from 0 to 1, not 7" in said


@pytest.mark.long
@pytest.mark.parametrize("name", ["objects.csv", "field.csv", "report.html", "plots/confusion.svg", "scores.json"])
def test_files_of_others_stay(capsys, data, tmp_path, name):
    path = tmp_path / "out" / name
    path.parent.mkdir(parents=True)
    path.write_text("[1, 2]")
    assert f"holds {name}, which no evaluation wrote" in complaint(capsys, MODEL, data, "-o", tmp_path / "out")
    assert contents(tmp_path) == {f"out/{name}": b"[1, 2]"}


@pytest.mark.long
def test_an_interrupt_ends_it_with_130_and_writes_nothing(data, tmp_path):
    folder = draw_set(tmp_path / "set", 1)
    for name in ("image.jpg", "mask.png", "lens.yaml", "scene.json"):
        part, suffix = name.split(".")
        for number in range(1, 4000):
            (folder / f"{part}{number:04d}.{suffix}").hardlink_to(folder / f"{part}0000.{suffix}")
    command = [str(BIN / "vm-evaluate"), str(MODEL), str(folder), "-o", str(tmp_path / "out"), "--workers", "2"]

    with subprocess.Popen(
        command, preexec_fn=heed_interrupts, start_new_session=True, stderr=subprocess.PIPE, text=True
    ) as process:
        while len(Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()) < 2:
            assert process.poll() is None
            time.sleep(0.1)
        time.sleep(1)  # so that the workers evaluate pictures
        process.send_signal(signal.SIGINT)
        said = process.stderr.read()
    assert process.returncode == 130
    assert "stopped" in said
    assert "Traceback" not in said
    assert not (tmp_path / "out").exists()
