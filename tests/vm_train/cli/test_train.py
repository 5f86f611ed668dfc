"""vm-train as a user types it: real processes that are stopped, killed and continued."""

import fcntl
import json
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import pytest
import torch

from tests.vm_train.commands import COMMAND, SMALL, environment, run
from tests.vm_train.drawn import CLASSES, draw_set
from vm_export.checkpoint import Checkpoint
from vm_train.learning.log import read_log


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return draw_set(tmp_path_factory.mktemp("drawn"), 30)


@pytest.fixture(scope="module")
def configuration(tmp_path_factory):
    path = tmp_path_factory.mktemp("configuration") / "train.toml"
    path.write_text(CLASSES + SMALL)
    return path


@pytest.fixture(scope="module")
def whole(data, configuration, tmp_path_factory):
    """A training that nobody disturbs."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    done = run(data, "-o", folder, "--config", configuration, "--workers", 1, "--threads", 1)
    return folder, done


def weights(path):
    return Checkpoint.load(path).network.state_dict()


def same(first, second):
    one, other = weights(first), weights(second)
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)


def test_a_training_leaves_a_network_a_log_and_what_it_was_made_of(whole, data):
    folder, done = whole
    assert re.search(r"30 pictures: \d+ for training, \d+ for validation, \d+ for test", done.stdout)
    assert re.search(r"model\.pt: average precision 0\.\d+ on the validation, \d+ pictures/s", done.stdout)
    assert {path.name for path in folder.iterdir()} == {
        "train.toml",
        "pictures.json",
        "run.json",
        "state.pt",
        "log.jsonl",
        "tensorboard",
        "round1.pt",
        "round2.pt",
        "model.pt",
    }
    split = json.loads((folder / "pictures.json").read_text())
    count = len(split["training"])
    records = [record for _, record in read_log(folder / "log.jsonl")]
    steps = [each for each in records if "loss" in each]
    assert [(each["round"], each["step"]) for each in steps] == [
        (each, step) for each in (1, 2) for step in range(1, 3 * -(-count // 4) + 1)
    ]
    assert [each["epoch"] for each in records if "score" in each] == [1, 2, 3, 1, 2, 3]
    assert len(list((folder / "tensorboard" / "round2").glob("events*"))) == 1
    checkpoint = Checkpoint.load(folder / "model.pt")
    assert checkpoint.manifest.provenance["training_pictures"] == str(count)
    assert checkpoint.manifest.provenance["data"] == data.name
    assert [each.name for each in checkpoint.manifest.classes] == ["ball", "line", "field", "environment"]


def test_its_network_is_exported_with_its_provenance(whole, tmp_path):
    from vm_embedded.network.model_file import read_model

    folder, _ = whole
    done = subprocess.run(
        [sys.executable, "-m", "vm_export.cli", str(folder / "model.pt"), "-o", str(tmp_path / "model.onnx")],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    made = read_model(tmp_path / "model.onnx").manifest
    assert made.provenance["made_by"].startswith("vm-train")
    assert made.provenance["selection"] == "hard"


def test_the_same_command_gives_the_same_weights(whole, data, configuration, tmp_path):
    run(data, "-o", tmp_path / "run", "--config", configuration, "--workers", 0, "--threads", 1, "--no-unpacked")
    assert same(tmp_path / "run" / "model.pt", whole[0] / "model.pt")
    assert same(tmp_path / "run" / "round2.pt", whole[0] / "round2.pt")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "steps"), [(signal.SIGINT, 2), (signal.SIGTERM, 9), (signal.SIGKILL, 9), (signal.SIGKILL, 24)]
)
def test_what_is_stopped_at_any_moment_ends_with_the_same_weights(how, steps, whole, data, configuration, tmp_path):
    folder = tmp_path / "run"
    arguments = [*COMMAND, data, "-o", folder, "--config", configuration, "--workers", "1", "--threads", "1"]
    process = subprocess.Popen(
        [str(each) for each in arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    wait_for_steps(folder / "log.jsonl", steps, process)
    process.send_signal(how)
    error = process.communicate(timeout=60)[1]
    assert process.returncode == (-signal.SIGKILL if how == signal.SIGKILL else 130)
    assert "Traceback" not in error
    if how != signal.SIGKILL:
        assert f"vm-train resume {folder} goes on" in error
    run("resume", folder, "--workers", 1, "--threads", 1)
    for name in ("model.pt", "round1.pt", "round2.pt"):
        assert same(folder / name, whole[0] / name)
    assert (folder / "log.jsonl").read_text() == (whole[0] / "log.jsonl").read_text()


def wait_for_steps(path, count, process):
    deadline = time.monotonic() + 120
    while not path.exists() or path.read_text().count("loss") < count:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.005)


@pytest.mark.slow
def test_two_processes_have_the_same_loss_curve(whole, data, configuration, tmp_path):
    command = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node=2", "--master-port=0", "--standalone"]
    done = subprocess.run(
        [*command, "-m", "vm_train", data, "-o", tmp_path / "run", "--config", configuration, "--workers", "0"],
        capture_output=True,
        text=True,
        timeout=240,
        env=environment(),
    )
    assert done.returncode == 0, done.stderr
    curves = [
        [record["loss"] for _, record in read_log(folder / "log.jsonl") if "loss" in record]
        for folder in (whole[0], tmp_path / "run")
    ]
    assert curves[1] == pytest.approx(curves[0], rel=2e-3)
    scores = [
        [record["score"] for _, record in read_log(folder / "log.jsonl") if "score" in record]
        for folder in (whole[0], tmp_path / "run")
    ]
    assert scores[1] == pytest.approx(scores[0], abs=0.02)


def test_a_finished_training_says_so_and_a_begun_one_is_not_begun_again(whole, data, configuration):
    folder, _ = whole
    assert "finished already" in run("resume", folder).stdout
    again = run(data, "-o", folder, "--config", configuration, code=1)
    assert f"vm-train resume {folder}" in again.stderr


def test_faults_are_named_before_the_training_begins_and_skipped_or_refused(data, configuration, tmp_path):
    folder = tmp_path / "data"
    folder.mkdir()
    for path in data.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    (folder / "mask0003.png").unlink()
    lens = folder / "lens0005.yaml"
    lens.write_text(lens.read_text().replace("focal_length", "focal_lenght"))
    (folder / "image0007.jpg").write_bytes((folder / "image0007.jpg").read_bytes()[:900])
    strict = run(folder, "-o", tmp_path / "strict", "--config", configuration, "--strict", code=1)
    for name in ("mask0003.png", "lens0005.yaml", "image0007.jpg"):
        assert name in strict.stderr
    assert not (tmp_path / "strict").exists()
    skipped = run(folder, "-o", tmp_path / "run", "--config", configuration, "--set", "training.epochs=1")
    assert "27 pictures" in skipped.stdout
    used = json.loads((tmp_path / "run" / "pictures.json").read_text())
    assert not {"0003", "0005", "0007"} & {number for part in used.values() for number in part}


def test_an_empty_part_is_named(data, configuration, tmp_path):
    done = run(data, "-o", tmp_path / "run", "--config", configuration, "--set", "data.validation=0", code=1)
    assert "validation" in done.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--set", "training.epoch=3"], "did you mean 'epochs'"),
        (["--config", "none.toml"], "can't read configuration none.toml"),
        (["--training", "none.txt"], "none.txt"),
        pytest.param(["--device", "cuda"], "no GPU", id="no gpu"),
    ],
)
def test_wrong_options_end_in_one_line(arguments, said, data, configuration, tmp_path):
    given = arguments if "--config" in arguments else ["--config", configuration, *arguments]
    done = run(data, "-o", tmp_path / "run", *given, code=1)
    assert said in done.stderr
    assert done.stderr.startswith("vm-train: ")


def test_a_folder_without_pictures_or_a_training_ends_in_one_line(tmp_path):
    assert "no pictures in" in run(tmp_path, "-o", tmp_path / "run", code=1).stderr
    assert "holds no training" in run("resume", tmp_path, code=1).stderr


def test_the_rate_finder_proposes_a_rate(data, configuration, tmp_path):
    done = run("rate", data, "--config", configuration, "--steps", 60, "--plot", tmp_path / "rate.png")
    proposed = float(re.search(r"proposed: training\.rate = (\S+)", done.stdout)[1])
    assert 1e-4 < proposed < 1.0
    assert (tmp_path / "rate.png").read_bytes().startswith(b"\x89PNG")


def test_the_preview_is_a_picture(data, configuration, tmp_path):
    done = run("preview", data, "--config", configuration, "--count", 2, "--output", tmp_path / "sheet.jpg")
    assert "2 pictures" in done.stdout
    assert (tmp_path / "sheet.jpg").stat().st_size > 10000


def test_a_configuration_can_be_written_and_used(data, tmp_path):
    (tmp_path / "train.toml").write_text(run("config").stdout)
    done = run("check", data, "--config", tmp_path / "train.toml")
    assert "no picture shows class goal" in done.stderr  # of the usual classes, this set has no goals and no robots


def command(module, *arguments, code=0):
    done = subprocess.run(
        [sys.executable, "-m", module, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=240,
        env=environment(),
    )
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done


def copied(whole, tmp_path):
    return Path(shutil.copytree(whole[0], tmp_path / "run"))


def test_a_configuration_that_was_edited_is_refused(whole, tmp_path):
    folder = copied(whole, tmp_path)
    path = folder / "train.toml"
    path.write_text(path.read_text().replace("epochs = 3", "epochs = 5"))
    assert "train.toml or pictures.json was changed" in run("resume", folder, code=1).stderr


def test_a_training_in_work_is_left_alone(whole, tmp_path):
    folder = copied(whole, tmp_path)
    with (folder / "run.json").open() as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert f"another process is training in {folder}" in run("resume", folder, code=1).stderr


def test_files_of_others_are_not_written_over(data, configuration, tmp_path):
    (tmp_path / "train.toml").write_text("# mine\n" + configuration.read_text())
    done = run(data, "-o", tmp_path, "--config", tmp_path / "train.toml", code=1)
    assert "holds train.toml, which a training would write over" in done.stderr
    assert (tmp_path / "train.toml").read_text().startswith("# mine")


def test_a_training_goes_on_where_its_folders_were_moved_to(whole, data, tmp_path):
    folder = copied(whole, tmp_path)
    (folder / "state.pt").unlink()
    moved = Path(shutil.copytree(data, tmp_path / "moved"))
    run("resume", folder, "--data", moved, "--workers", 1, "--threads", 1)
    assert same(folder / "model.pt", whole[0] / "model.pt")
    assert not (folder / "unpacked").exists()


def test_a_damaged_log_is_cut_where_it_is_damaged(whole, tmp_path):
    folder = copied(whole, tmp_path)
    (folder / "state.pt").unlink()
    with (folder / "log.jsonl").open("a") as file:
        file.write("\0\0\n")
    run("resume", folder, "--workers", 1, "--threads", 1)
    assert (folder / "log.jsonl").read_text() == (whole[0] / "log.jsonl").read_text()


def test_a_loss_that_is_no_number_ends_the_training_at_once(data, configuration, tmp_path):
    wild = ["--set", "training.rate=1000", "--set", "training.clip=0", "--set", "training.optimizer=sgd"]
    done = run(data, "-o", tmp_path / "run", "--config", configuration, *wild, code=1)
    assert "lower training.rate" in done.stderr


def test_a_full_disk_ends_in_one_line(data, configuration, tmp_path):
    """A limit on the size of files stands for the disk."""
    limited = ["bash", "-c", 'trap "" XFSZ; ulimit -f 8; exec "$@"', "bash", *COMMAND, data, "-o", tmp_path / "run"]
    done = subprocess.run(
        [str(each) for each in [*limited, "--config", configuration, "--no-unpacked", "--workers", "0"]],
        capture_output=True,
        text=True,
        timeout=240,
        env=environment(),
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("vm-train: can't write")
    assert "Traceback" not in done.stderr


def test_a_validation_without_objects_chooses_by_all_classes(data, configuration, tmp_path):
    without = [each for each in range(30) if json.loads((data / f"scene{each:04d}.json").read_text())["ball"] is None]
    assert without
    (tmp_path / "validation.txt").write_text("\n".join(f"{each:04d}" for each in without))
    done = run(data, "-o", tmp_path / "run", "--config", configuration, "--validation", tmp_path / "validation.txt")
    assert "the validation shows no ball: networks are chosen by all classes" in done.stderr
    scores = [record["score"] for _, record in read_log(tmp_path / "run" / "log.jsonl") if "score" in record]
    assert min(scores) > 0.0


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
    command("vm_train.cli.evaluate", model, folder, "--list", split, "-o", tmp_path / "report")
    part = command("vm_train.cli.evaluate", model, folder, "--part", "test", "-o", tmp_path / "none", code=1)
    assert "give it with --list" in part.stderr


@pytest.mark.slow
def test_a_hexagonal_network_trains_and_is_not_exported(data, configuration, tmp_path):
    folder = tmp_path / "run"
    hexagonal = ["--set", "mesh.grid=hexagonal", "--set", "mesh.equal_at=1.5", "--set", "training.selection=balanced"]
    run(data, "-o", folder, "--config", configuration, *hexagonal)
    assert Checkpoint.load(folder / "model.pt").grid.equal_at == 1.5
    done = subprocess.run(
        [sys.executable, "-m", "vm_export.cli", str(folder / "model.pt")], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 1
    assert "hexagonal mesh" in done.stderr
    assert not Path(folder / "model.onnx").exists()


@pytest.mark.slow
def test_a_small_network_learns_to_find_the_balls_of_pictures_it_has_not_seen(configuration, tmp_path):
    """Five layers of four channels; docs/training.md has the whole of it."""
    data = draw_set(tmp_path / "data", 160, seed=4, size=(320, 256))
    settings = ["mesh.max_distance=5", "network.depth=5", "training.selection=balanced", "training.epochs=25"]
    settings += ["training.rate=0.02", "data.test=0.25"]
    overrides = [each for entry in settings for each in ("--set", entry)]
    run(data, "-o", tmp_path / "run", "--config", configuration, *overrides)
    model, split = tmp_path / "run" / "model.pt", tmp_path / "run" / "pictures.json"
    done = subprocess.run(
        [sys.executable, "-m", "vm_train.cli.evaluate", model, data, "--list", split, "-o", tmp_path / "report"],
        capture_output=True,
        text=True,
        timeout=240,
        env=environment(),
    )
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "report" / "scores.json").read_text())["objects"]["ball"]
    whole = found["iou_0.5"]["all"]
    assert whole["truths"] >= 20
    assert whole["recall"] > 0.9
    assert whole["false_per_picture"] < 0.5
