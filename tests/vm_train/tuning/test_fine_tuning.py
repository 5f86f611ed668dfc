"""vm-train tune as a user types it: real processes that are stopped, killed and resumed."""

import json
import re
import shutil
import signal

import numpy as np
import pytest

from tests.vm_train.commands import run, run_and_stop
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import CloseLook
from vm_export.look_weights import look_of
from vm_train.boxes.read import read_boxes
from vm_train.cli.train import main
from vm_train.runs.log import read_log
from vm_train.tuning.boxed_objects import split_by_recording

from ..drawn import draw_set


@pytest.fixture(scope="module")
def tune(frames, tiny):
    """Runs vm-train tune with one worker; more arguments override these."""

    def run_tuning(output, *arguments, boxes=frames, **options):
        given = ["--from", "ball", "--names", "0=ball", "--config", tiny, "--workers", 1, *arguments]
        return run("tune", boxes, "-o", output, *given, **options)

    return run_tuning


@pytest.fixture(scope="module")
def whole(tune, tmp_path_factory):
    """A fine-tuning that nobody disturbs."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    return folder, tune(folder)


def test_it_leaves_a_model_file_a_report_and_what_it_was_made_of(whole, frames):
    folder, done = whole
    lines = done.stdout.splitlines()
    assert lines[0] == f"{frames}: 12 frames of 3 recordings: 4 for training, 4 for validation, 4 for the test"
    assert re.fullmatch(r"\d+ patches of your frames, \d+ of them show the object", lines[1])
    for epoch in (1, 2):
        assert re.fullmatch(
            rf"epoch {epoch} of 2: validation loss [\d.]+ for your frames, [\d.]+ for rendered patches"
            r"( \(the best so far\))?, with \d+0% of the new weights; "
            r"loss [\d.]+, learning rate [\d.e-]+, 0:00:\d\d left",
            lines[1 + epoch],
        )
    assert re.search(
        r"model.onnx: in 4 frames for the test, the look alone finds \d+ of \d+ boxes and \d+ false", lines[4]
    )
    assert lines[6:] == [
        f"report: {folder / 'report.html'}",
        f"next: vm-evaluate --boxes {frames} --names 0=ball --list {folder / 'pictures.json'} ball "
        f"{folder / 'model.onnx'} -o evaluation",
        f"next: vm-detect --model {folder / 'model.onnx'} FRAMES --lens LENS.yaml --height METERS --pitch ANGLE "
        "--save-overlay found",
    ]
    assert "with fewer than 25 frames for training" in done.stderr
    assert {path.name for path in folder.iterdir()} == {
        *("tune.toml", "run.json", "before.onnx", "rendered.npz", "patches", "look.pt", "log.jsonl", "tensorboard"),
        *("state.pt", "model.onnx", "report.html", "result.json", "pictures.json"),
    }
    result = json.loads((folder / "result.json").read_text())
    assert result["before"]["all"]["boxes"] == result["after"]["all"]["boxes"] > 0
    page = (folder / "report.html").read_text()
    assert "learned from 4 frames" in page
    assert "4 frames of other recordings" in page
    parts = json.loads((folder / "pictures.json").read_text())
    names = [{name[0] for name in parts[part]} for part in ("training", "validation", "test")]
    assert sorted(map(len, names)) == [1, 1, 1]
    assert set.union(*names) == set("abc")


def test_the_new_model_differs_only_in_its_close_look(whole):
    folder, _ = whole
    before, after = read_model(model_path("ball")), read_model(folder / "model.onnx")
    assert after.manifest.classes == before.manifest.classes
    assert after.manifest.self_test.as_dict() == before.manifest.self_test.as_dict()
    assert after.look != before.look
    assert after.manifest.look.classes == before.manifest.look.classes
    provenance = after.manifest.look.provenance
    assert provenance["fine_tuned_frames"] == "4"
    assert provenance["fine_tuned_from_sha256"] == before.sha256
    assert provenance["data"] == before.manifest.look.provenance["data"]
    CloseLook.of(after)  # loads, and passes its self-tests


@pytest.mark.long
def test_a_look_of_several_classes_still_judges_all_of_them(tune, tmp_path):
    tune(tmp_path / "run", "--from", "soccer")
    before, after = read_model(model_path("soccer")), read_model(tmp_path / "run" / "model.onnx")
    assert after.manifest.look.names == ("ball", "goal", "robot")
    assert after.manifest.look.classes == before.manifest.look.classes
    size = after.manifest.look.size
    patches = np.random.default_rng(0).integers(0, 256, (20, size, size, 3), np.uint8)
    old, new = (CloseLook.of(each).run(patches) for each in (before, after))
    assert np.isfinite(new).all()
    assert (np.abs(new - old).max(axis=(0, 2)) > 1e-4).all()  # they share layers, so all change


@pytest.mark.long
def test_without_held_out_frames_nothing_is_measured_and_those_with_lenses_can_be_tried(tune, frames, tmp_path):
    seen = shutil.copytree(frames, tmp_path / "seen")
    lens = draw_set(tmp_path / "drawn", 1) / "lens0000.yaml"
    for image in seen.glob("*.jpg"):
        shutil.copy(lens, image.with_suffix(".yaml"))
    (seen / "object.toml").write_text('shape = "sphere"\nradius = 0.11\n')
    done = tune(tmp_path / "run", "--set", "data.validation=0", "--set", "data.test=0", boxes=seen)
    lines = done.stdout.splitlines()
    assert re.match(r"epoch 1 of 2: validation loss [\d.]+ for rendered patches \(the best so far\), with ", lines[2])
    model = tmp_path / "run" / "model.onnx"
    assert lines[4:] == [
        f"{model}: not measured, because no frames were held out",
        f"report: {tmp_path / 'run' / 'report.html'}",
        f"next: vm-detect --model {model} {seen} --object-radius 0.11 --save-overlay found",
    ]
    assert "nothing was measured" in (tmp_path / "run" / "report.html").read_text()


def test_a_fine_tuning_stays_on_the_processor(tune, whole, tmp_path):
    assert "runs on the CPU" in tune(tmp_path / "run", "--device", "cuda", code=1).stderr
    assert "runs on the CPU" in run("resume", whole[0], "--device", "cuda", code=1).stderr


def test_a_log_has_each_step_once(whole):
    folder, _ = whole
    records = [record for _, record in read_log(folder / "log.jsonl")]
    assert [each["step"] for each in records if "loss" in each] == list(range(1, 9))
    assert [each["epoch"] for each in records if "epoch" in each] == [1, 2]


def assert_same(folder, expected):
    for name in ("model.onnx", "look.pt", "result.json", "report.html", "log.jsonl"):
        assert (folder / name).read_bytes() == (expected / name).read_bytes(), name


@pytest.mark.parametrize(
    ("how", "wait"),
    [
        (signal.SIGKILL, "log.jsonl"),
        pytest.param(signal.SIGINT, "run.json", marks=pytest.mark.long),
        pytest.param(signal.SIGTERM, "log.jsonl", marks=pytest.mark.long),
        pytest.param(signal.SIGKILL, "patches/00000.npz", marks=pytest.mark.long),
        pytest.param(signal.SIGKILL, "model.onnx", marks=pytest.mark.long),
    ],
)
def test_what_is_stopped_at_any_moment_ends_with_the_same_bytes(how, wait, whole, frames, tiny, tmp_path):
    folder = tmp_path / "run"
    given = ["--from", "ball", "--names", "0=ball", "--config", tiny, "--workers", 1]
    run_and_stop(how, folder, wait, 0, "tune", frames, *given)
    run("resume", folder, "--workers", 2)
    assert_same(folder, whole[0])


@pytest.mark.long
def test_a_finished_one_says_so_and_a_begun_one_is_not_begun_again(whole, tune):
    folder, _ = whole
    assert "finished already" in run("resume", folder).stdout
    assert f"vm-train resume {folder}" in tune(folder, code=1).stderr


@pytest.mark.long
def test_changed_boxes_or_settings_are_refused(whole, frames, tmp_path):
    folder = shutil.copytree(whole[0], tmp_path / "run")
    moved = shutil.copytree(frames, tmp_path / "moved")
    assert "finished already" in run("resume", folder, "--data", moved).stdout
    next(path for path in sorted(moved.glob("*.txt")) if path.read_text()).write_text("")
    assert f"{moved} was changed since" in run("resume", folder, "--data", moved, code=1).stderr
    (folder / "tune.toml").write_text("[training]\nepochs = 3\n")
    assert "tune.toml was changed since" in run("resume", folder, code=1).stderr


@pytest.fixture
def complaint(frames, tmp_path, capsys):
    """What vm-train tune says about arguments that it can't use: one line."""

    def complain(*arguments):
        assert main(["tune", "-o", str(tmp_path / "run"), *map(str, arguments)]) == 1
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        return error

    return complain


def test_mistakes_are_told_in_one_line(complaint, frames, tmp_path):
    ball = ["--from", "ball", frames]
    assert "has no box of class ball" in complaint(*ball)
    assert "--names 0=ball" in complaint(*ball)
    assert "patience" in complaint(*ball, "--names", "0=ball", "--set", "training.patiense=3")
    assert not (tmp_path / "run").exists()


def test_boxes_that_are_only_in_the_test_leave_nothing(complaint, frames, tmp_path):
    folder = tmp_path / "boxes"
    shutil.copytree(frames, folder)
    for each in folder.glob("*.txt"):
        if each.name[0] != "b":
            each.write_text("")
    pictures = read_boxes(folder, None, {"0": "ball"}).pictures
    splits = {seed: split_by_recording(pictures, 0.3, 0.3, seed).test for seed in range(99)}
    seed = next(seed for seed, taken in splits.items() if pictures[int(taken[0])].image.name[0] == "b")
    options = ("--names", "0=ball", "--set", f"data.split_seed={seed}", "--set", "data.test=0.3")
    assert "part for training, has no box" in complaint(folder, "--from", "ball", *options)
    assert not (tmp_path / "run").exists()


def test_strict_refuses_faults_before_it_writes_anything(frames, tmp_path, tune):
    damaged = shutil.copytree(frames, tmp_path / "damaged")
    next(path for path in sorted(damaged.glob("*.txt")) if path.read_text()).write_text("0 0.5\n")
    error = tune(tmp_path / "run", "--strict", boxes=damaged, code=1).stderr
    assert "has 2 values" in error
    assert "leave out --strict" in error
    assert not (tmp_path / "run").exists()


def test_a_class_without_rendered_patches_needs_a_run(whole, tmp_path, complaint, frames):
    assert "holds no training" in complaint(frames, "--from", "ball", "--names", "0=ball", "--rendered", tmp_path)


def test_tune_config_prints_what_config_reads(tmp_path, tune):
    text = run("config", "tune").stdout
    assert "[training]" in text
    path = tmp_path / "tune.toml"
    path.write_text(text.replace("epochs = 8", "epochs = 0"))
    assert "epochs must be" in tune(tmp_path / "run", "--config", path, code=1).stderr


def test_weights_of_a_file_written_again_are_the_same(whole):
    """Reading a look network back from a model file and writing it again loses nothing."""
    again = look_of(read_model(whole[0] / "model.onnx"))
    patches = np.random.default_rng(0).integers(0, 256, (5, again.contract.size, again.contract.size, 3), np.uint8)
    look = CloseLook.of(read_model(whole[0] / "model.onnx"))
    import torch

    with torch.inference_mode():
        np.testing.assert_allclose(again.network(torch.from_numpy(patches)).numpy(), look.run(patches), atol=1e-5)
