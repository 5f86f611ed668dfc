"""vm-evaluate --boxes as a user types it: with and without lens and pose, and what goes wrong."""

import json
import shutil
from functools import partial

import pytest

from tests.programs import run_program
from tests.test_docs import TOP
from vm_train.cli.evaluate import main
from vm_train.data.split import Split, write_split

from ...drawn_scenes import CHECKPOINT

run = partial(run_program, "vm-evaluate")

DEMO = TOP / "tests" / "fixtures" / "demo"


@pytest.fixture(scope="module")
def boxes(tmp_path_factory):
    """Four rendered pictures with lens, pose, and the boxes of the balls that `ball` finds in them."""
    folder = tmp_path_factory.mktemp("found")
    pictures = [DEMO / f"image000000{number}.jpg" for number in range(4)]
    run_program("vm-detect", *pictures, "--save-boxes", folder / "boxes")
    return folder / "boxes"


@pytest.fixture
def without_lenses(boxes, tmp_path):
    """The same frames without their lens files."""
    folder = shutil.copytree(boxes, tmp_path / "plain")
    for each in folder.glob("lens*"):
        each.unlink()
    return folder


def complaint(capsys, *arguments):
    """What it has to say of arguments that it can't use: one line."""
    assert main([str(each) for each in arguments]) == 1
    said = capsys.readouterr().err.strip().splitlines()
    assert said[-1].startswith("vm-evaluate: ")
    return said[-1]


def test_with_lens_and_pose_the_whole_detector_is_scored(boxes, tmp_path):
    done = run("--boxes", boxes, "ball", "soccer", "-o", tmp_path / "out", "--workers", 1)
    assert "4 of 4 frames" in done.stdout
    assert "the whole detector" in done.stdout
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    assert scores["about"]["measured"] == "whole detector"
    ball, soccer = scores["networks"]
    assert (ball["network"], soccer["network"]) == ("ball", "soccer")
    count = sum(len(each.read_text().split("\n")) - 1 for each in boxes.glob("image*.txt"))
    everything = ball["scores"]["all"]
    assert everything == {"boxes": count, "found": count, "false": 0, "recall": 1.0, "average_precision": 1.0}
    assert sum(each["boxes"] for size, each in ball["scores"].items() if size != "all") == count
    page = (tmp_path / "out" / "report.html").read_text()
    assert "the whole detector" in page
    assert "ball" in page


def test_an_object_radius_changes_what_the_detector_finds(boxes, tmp_path):
    """As an option, or in the object.toml of the boxes."""
    folder = shutil.copytree(boxes, tmp_path / "boxes")
    (folder / "object.toml").write_text("radius = 0.25\n")
    given, read = (
        run("--boxes", each, "ball", *options, "--workers", 1)
        for each, options in ((boxes, ("--object-radius", "0.25")), (folder, ()))
    )
    assert given.stdout.replace(str(boxes), str(folder)) == read.stdout
    assert "100 %" not in read.stdout.split("recall")[1].splitlines()[1]
    assert "object radius 0.25 m, from object.toml" in read.stderr


def test_without_lens_the_close_look_is_scored(without_lenses, tmp_path):
    done = run("--boxes", without_lenses, "ball", "-o", tmp_path / "out", "--workers", 1)
    assert "the close look alone" in done.stdout
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    assert scores["about"]["measured"] == "close look"
    assert scores["networks"][0]["scores"]["all"]["found"] >= 1


@pytest.mark.long
def test_a_frame_without_pose_among_others_is_told(boxes, tmp_path):
    folder = shutil.copytree(boxes, tmp_path / "some")
    min(folder.glob("lens*")).unlink()
    done = run("--boxes", folder, "ball", "--workers", 1)
    assert "the close look alone" in done.stdout
    assert "Only 3 of the 4 frames have a lens file" in done.stderr


def test_a_list_chooses_the_frames_and_test_is_the_default(boxes, tmp_path, capsys):
    names = sorted(each.name for each in boxes.glob("*.jpg"))
    parts = tmp_path / "pictures.json"
    write_split(parts, Split(tuple(names[:2]), (), tuple(names[2:3])))
    done = run("--boxes", boxes, "--list", parts, "ball", "--workers", 1)
    assert "1 of 4 frames" in done.stdout
    assert "2 of 4 frames" in run("--boxes", boxes, "--list", parts, "--part", "training", "ball").stdout
    assert "no frame of part validation" in complaint(
        capsys, "--boxes", boxes, "--list", parts, "--part", "validation", "ball"
    )
    write_split(parts, Split((), (), ("imageNOWHERE.jpg",)))
    assert "'imageNOWHERE.jpg'" in complaint(capsys, "--boxes", boxes, "--list", parts, "ball")
    assert "give it with --list" in complaint(capsys, "--boxes", boxes, "--part", "test", "ball")


def test_mistakes_are_told_in_one_line(boxes, without_lenses, tmp_path, capsys):
    assert "has no box of class ball" in complaint(capsys, "--boxes", boxes, "ball", "--names", "ball=football")
    assert "give one network or several" in complaint(capsys, "--boxes", boxes, "--names", "0=ball")
    assert "there is no folder" in complaint(capsys, "--boxes", tmp_path / "nowhere", "ball")
    assert "not an ONNX file; vm-export" in complaint(capsys, "--boxes", boxes, CHECKPOINT)
    (tmp_path / "report.html").write_text("mine")
    assert "which no evaluation wrote" in complaint(capsys, "--boxes", boxes, "ball", "-o", tmp_path)
    bare = tmp_path / "bare.onnx"
    run_program("vm-export", "ball", "--no-look", "-o", bare)
    assert "has no close look" in complaint(capsys, "--boxes", without_lenses, bare, "--workers", 1)
    assert main(["--boxes", str(boxes), str(bare), "--workers", "1"]) == 0  # with lens and pose, it needs none


def test_networks_may_follow_new_names(without_lenses):
    """Although --names takes all that follows."""
    (without_lenses / "classes.txt").unlink()
    done = run("--boxes", without_lenses, "--workers", 1, "--names", "0=ball", "ball")
    assert "ball" in done.stdout


def test_its_help_needs_no_folder():
    assert "--boxes DIR" in run("--boxes", "--help").stdout


def test_an_evaluation_of_another_kind_in_the_folder_is_replaced(boxes, tmp_path):
    out = tmp_path / "out"
    run("--boxes", boxes, "ball", "-o", out, "--workers", 1)
    (out / "points.csv").write_text("class\n")
    run("--boxes", boxes, "ball", "-o", out, "--workers", 1)
    assert {each.name for each in out.iterdir()} == {"scores.json", "report.html"}
