"""vm-train look as a user types it: real processes that are stopped, killed and resumed."""

import json
import re
import shutil
import signal

import numpy as np
import pytest

from tests.drawn_scenes import CHECKPOINT
from tests.vm_train.commands import run, run_and_stop, run_module
from tests.vm_train.drawn import CLASSES, draw_set
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_export.eight_bits import rounded
from vm_export.look_checkpoint import LookCheckpoint
from vm_train.cli.train import main
from vm_train.data.pictures import find_pictures
from vm_train.data.split import Split, read_split, write_split
from vm_train.runs.log import read_log
from vm_train.runs.run import locked


@pytest.fixture(scope="module")
def look(drawn, tiny):
    """Runs vm-train look on the drawn pictures with one worker; more arguments override these."""

    def run_look(output, *arguments, **options):
        given = ["--from", "ball", "--config", tiny, "--workers", 1, *arguments]
        return run("look", drawn, "-o", output, *given, **options)

    return run_look


@pytest.fixture(scope="module")
def whole(look, tmp_path_factory):
    """A training that nobody disturbs."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    return folder, look(folder)


def test_a_training_leaves_a_network_a_log_and_what_it_was_made_of(whole, drawn):
    folder, done = whole
    lines = done.stdout.splitlines()
    assert re.fullmatch(r".*: 20 pictures: \d+ for training, \d+ for validation, 0 for test", lines[0])
    learned_from = r"ball: \d+ patches for training, \d+ of them with the object; for validation"
    assert re.fullmatch(learned_from, lines[1])
    assert re.fullmatch(r"  \d+ proposals, \d+ of them right: \d+ of \d+ visible objects \(\d+ %\)", lines[2])
    assert lines[3].startswith("validation AP: ")
    for number, line in enumerate(lines[4:8], start=1):
        learned = r"validation AP of ball [\d.]+, .*; loss [\d.]+, learning rate [\d.e-]+, 0:00:\d\d left"
        assert re.fullmatch(rf"epoch {number} of 4: {learned}", line), line
    assert "look.pt, ball: in " in lines[8]
    output = folder / "model.onnx"
    assert lines[9] == f"next: vm-export {folder / 'mesh.onnx'} --look {folder / 'look.pt'} -o {output}"
    assert {path.name for path in folder.iterdir()} == {
        *("look.toml", "pictures.json", "run.json", "mesh.onnx", "patches", "state.pt", "log.jsonl", "tensorboard"),
        *("look.pt", "result.json"),
    }
    records = [record for _, record in read_log(folder / "log.jsonl")]
    steps = [each["step"] for each in records if "loss" in each]
    assert steps == list(range(1, len(steps) + 1))
    assert [(each["round"], each["epoch"]) for each in records if "epoch" in each] == [(1, 1), (1, 2), (1, 3), (1, 4)]
    result = json.loads((folder / "result.json").read_text())
    assert list(result) == ["ball"]
    assert sum(each["count"] for each in result["ball"]["bins"]) > 0


def test_what_the_training_of_the_mesh_network_held_out_stays_held_out(whole, look, drawn, tmp_path):
    for name in ("mesh.onnx", "run.json"):
        shutil.copy(whole[0] / name, tmp_path)
    numbers = tuple(each.number for each in find_pictures(drawn))
    write_split(tmp_path / "pictures.json", Split(numbers[4:], numbers[2:4], numbers[:2]))
    done = look(tmp_path / "run", "--from", tmp_path / "mesh.onnx", "--set", "training.epochs=2")
    made = read_split(tmp_path / "run" / "pictures.json")
    assert made.test == numbers[:2]
    assert set(numbers[2:4]) < set(made.validation)
    assert f"{len(made.training)} for training, {len(made.validation)} for validation, 2 for test" in done.stdout


def test_its_network_knows_its_contract_and_where_it_comes_from(whole, drawn):
    folder, _ = whole
    made = LookCheckpoint.load(folder / "look.pt")
    contract = made.contract
    (ball,) = contract.classes
    assert (ball.name, ball.upright_radius, ball.mesh_weight) == ("ball", 0.0, 0.0)
    assert (contract.size, contract.channels) == (16, (4, 6, 8))
    assert (contract.extent, contract.max_proposals) == (1.75, 10)
    assert made.examples.shape == (4, 16, 16, 3)
    assert contract.provenance["data"] == drawn.name
    assert re.fullmatch(rf"\d+ validation pictures of {drawn.name}", ball.calibrated_on)
    assert contract.provenance["mesh_sha256"] == json.loads((folder / "run.json").read_text())["made_from"]["mesh.onnx"]
    for layer in (*made.network.typed_convolutions, made.network.hidden):
        kernel = layer.weight.detach().numpy()
        assert np.array_equal(kernel, rounded(kernel))
    ((scale, offset),) = made.network.calibration.tolist()
    calibration = json.loads((folder / "result.json").read_text())["ball"]["calibration"]
    assert (scale, offset) == pytest.approx((calibration["scale"], calibration["offset"]))


@pytest.mark.long
def test_the_next_command_attaches_it_to_its_mesh_network(whole):
    folder, done = whole
    _, *arguments = done.stdout.splitlines()[-1].removeprefix("next: ").split()
    run_module("vm_export.cli", *arguments)
    found = read_model(folder / "model.onnx").manifest.look
    assert LookCheckpoint.load(folder / "look.pt").contract.provenance.items() <= found.provenance.items()
    assert found.self_test is not None
    (folder / "model.onnx").unlink()


@pytest.mark.long
def test_two_workers_give_the_same_bytes(whole, look, tmp_path):
    look(tmp_path / "run", "--workers", 2)
    assert_same(tmp_path / "run", whole[0])


def assert_same(folder, expected):
    for name in ("look.pt", "log.jsonl", "result.json"):
        assert (folder / name).read_bytes() == (expected / name).read_bytes(), name


@pytest.mark.parametrize(
    ("how", "steps"),
    [
        pytest.param(signal.SIGINT, 0, marks=pytest.mark.long),
        (signal.SIGKILL, 20),
        pytest.param(signal.SIGTERM, 40, marks=pytest.mark.long),
        pytest.param(signal.SIGINT, 3, marks=pytest.mark.long),
        pytest.param(signal.SIGKILL, 0, marks=pytest.mark.long),
        pytest.param(signal.SIGKILL, 38, marks=pytest.mark.long),
    ],
)
def test_what_is_stopped_at_any_moment_ends_with_the_same_bytes(how, steps, whole, drawn, tiny, tmp_path):
    """0 steps: while patches are collected, by two workers."""
    folder = tmp_path / "run"
    arguments = ["look", drawn, "--from", "ball", "--config", tiny, "--workers", 1 if steps else 2]
    run_and_stop(how, folder, "log.jsonl" if steps else "run.json", steps, *arguments)
    run("resume", folder, "--workers", 1)
    assert_same(folder, whole[0])


@pytest.mark.long
def test_a_finished_training_says_so_and_a_begun_one_is_not_begun_again(whole, look):
    folder, _ = whole
    assert "finished already" in run("resume", folder).stdout
    assert f"vm-train resume {folder}" in look(folder, code=1).stderr


def test_a_training_in_work_is_left_alone(whole, tmp_path):
    folder = shutil.copytree(whole[0], tmp_path / "run")
    with locked(folder):
        assert f"another process is training in {folder}" in run("resume", folder, code=1).stderr


@pytest.mark.long
def test_a_training_goes_on_where_its_folders_were_moved_to(whole, drawn, tmp_path):
    folder = shutil.copytree(whole[0], tmp_path / "run")
    (folder / "state.pt").unlink()
    (folder / "patches" / "00000.npz").unlink()
    moved = shutil.copytree(drawn, tmp_path / drawn.name)
    content = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(content | {"data": str(tmp_path / "gone")}))
    assert "there is no folder" in run("resume", folder, "--workers", 1, code=1).stderr
    run("resume", folder, "--data", moved, "--workers", 1)
    assert_same(folder, whole[0])


@pytest.fixture
def complaint(drawn, tiny, tmp_path, capsys):
    """What vm-train look says about arguments that it can't use: one line."""

    def complain(*arguments):
        given = ["look", drawn, "-o", tmp_path / "run", "--from", "ball", "--config", tiny, *arguments]
        assert main([str(each) for each in given]) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("vm-train: ")
        return line

    return complain


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--from", "baller"], "unknown network 'baller'; did you mean 'ball'?"),
        (["--from", "none.onnx"], "none.onnx"),
        (["--from", "none.txt"], "a model must be a checkpoint (.pt) or a model file (.onnx)"),
        (["--from", str(CHECKPOINT)], "a close look judges peaks, and this network has none"),
        (["--set", "patches.size=1000"], "[patches] size must be a whole number from 8 to 128 px, not 1000"),
        (["--set", "patches.object_class=goal"], "unknown entry in [patches] 'object_class'"),
        (["--set", "data.validation=0"], "validation gets none of the 20 pictures"),
        (["--set", "classes=1"], "--set 'classes=1' must have the form SECTION.ENTRY=VALUE"),
        (["--config", "none.toml"], "can't read configuration none.toml"),
    ],
)
def test_what_cannot_work_ends_in_one_line(arguments, said, complaint):
    assert said in complaint(*arguments)


def test_a_class_that_the_masks_do_not_have_ends_in_one_line(complaint, tmp_path):
    path = tmp_path / "look.toml"
    path.write_text(CLASSES.replace("ball =", "puck ="))
    assert "has class 'ball', but those of the kind object in [classes] are puck" in complaint("--config", path)


def test_files_of_others_are_not_written_over(complaint, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "look.toml").write_text("# mine")
    assert "holds look.toml, which a training would overwrite" in complaint()


@pytest.mark.long
def test_a_loss_that_is_no_number_ends_the_training(look, tmp_path):
    done = look(tmp_path / "run", "--set", "training.rate=1000", "--set", "training.epochs=60", code=1)
    assert "begin again with a lower training.rate" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_missing_gpu_is_named_before_anything_is_written(whole, look, tmp_path):
    assert "torch finds no GPU" in run("resume", whole[0], "--device", "cuda", code=1).stderr
    assert "torch finds no GPU" in look(tmp_path / "run", "--device", "cuda", code=1).stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.long
def test_pictures_without_the_object_end_in_one_line(drawn, tiny, tmp_path):
    """Only pictures without a ball: their scenes and masks say so."""
    folder = draw_set(tmp_path / "data", 12, seed=3)
    for path in folder.glob("scene*.json"):
        path.write_text(json.dumps(json.loads(path.read_text()) | {"ball": None}))
    arguments = ["--from", "ball", "--config", tiny, "--workers", 1]
    done = run("look", folder, "-o", tmp_path / "run", *arguments, code=1)
    assert re.search(r"none of the \d+ patches for training show the object ball", done.stderr)
    assert "give more pictures if they are few" in done.stderr


def test_masks_of_other_colors_end_with_advice(look, tmp_path):
    path = tmp_path / "look.toml"
    path.write_text(CLASSES.replace("[0, 255, 0]", "[1, 2, 3]"))
    done = look(tmp_path / "run", "--config", path, code=1)
    assert "picture 0000: mask0000.png" in done.stderr
    assert "no picture for training can be used; vm-train check" in done.stderr.splitlines()[-1]


def test_its_configuration_can_be_written_and_used(look, tmp_path):
    text = run("config", "look").stdout
    assert "[patches]" in text
    (tmp_path / "look.toml").write_text(text.replace("epochs = 12", "epochs = 0"))
    done = look(tmp_path / "run", "--config", tmp_path / "look.toml", code=1)
    assert re.search(r"look.toml, line \d+: \[training\] epochs must be a whole number from 1", done.stderr)


@pytest.mark.long
def test_a_short_training_tells_balls_from_everything_else(tmp_path):
    data = draw_set(tmp_path / "data", 80, seed=11)
    settings = ["data.validation=0.3", "patches.size=16", "network.channels=[8, 12, 16]", "training.batch=64"]
    options = [part for each in settings for part in ("--set", each)]
    run("look", data, "--from", model_path("ball"), "-o", tmp_path / "run", *options, "--workers", 2)
    result = json.loads((tmp_path / "run" / "result.json").read_text())["ball"]
    assert result["average_precision"] > 0.9
    assert result["calibration_error"] < 0.1
    records = [record for _, record in read_log(tmp_path / "run" / "log.jsonl")]
    last = [each for each in records if "epoch" in each][-1]
    assert last["ball average_precision"] > 0.9
    assert last["ball center_error"] < 0.15
    assert np.isfinite(result["calibration"]["scale"])
