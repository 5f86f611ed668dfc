"""Trainings as a user runs them: real processes that are stopped, killed and resumed."""

import json
import os
import pty
import re
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from tests.folders import contents
from tests.vm_train.commands import COMMAND, environment, run, run_and_stop, wait_for_steps
from tests.vm_train.weights import same, weights_of
from vm_export.checkpoint import Checkpoint
from vm_train.runs.log import read_log
from vm_train.runs.run import locked

pytestmark = pytest.mark.long

VALIDATION = "validation_average_precision"


def same_network(first, second):
    return same(weights_of(first), weights_of(second))


def test_a_training_leaves_a_network_a_log_and_what_it_was_made_of(whole, data):
    folder, done = whole
    assert re.search(r"30 pictures: \d+ for training, \d+ for validation, \d+ for test", done.stdout)
    assert re.search(r"model\.pt: validation AP 0\.\d+, \d+ pictures/s", done.stdout)
    assert f"\nnext: vm-train look {data} --from {folder / 'model.pt'} -o {folder}-look\nnext: vm-export" in done.stdout
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
    assert [each["epoch"] for each in records if VALIDATION in each] == [1, 2, 3, 1, 2, 3]
    assert "validation AP: average precision of the mesh points of ball" in done.stdout
    shown = re.findall(
        r"^round (\d) of 2, epoch (\d) of 3: validation AP (\d\.\d{3})(?: \(the best so far\))?, \d+ pictures/s; "
        r"loss (\d\.\d{3}), learning rate ([\d.e-]+), 0:00:\d\d left$",
        done.stdout,
        re.MULTILINE,
    )
    scores = [each for each in records if VALIDATION in each]
    rates = {(each["round"], each["step"]): each["rate"] for each in steps}
    assert [each[4] for each in shown] == [f"{rates[each['round'], each['step']]:.2g}" for each in scores]
    assert [tuple(map(int, each[:2])) for each in shown] == [(each["round"], each["epoch"]) for each in scores]
    assert [each[2] for each in shown] == [f"{each[VALIDATION]:.3f}" for each in scores]
    first = [each["loss"] for each in steps[: len(steps) // 6]]
    assert shown[0][3] == f"{sum(first) / len(first):.3f}"
    assert len(list((folder / "tensorboard" / "round2").glob("events*"))) == 1
    checkpoint = Checkpoint.load(folder / "model.pt")
    assert checkpoint.manifest.provenance["training_pictures"] == str(count)
    assert checkpoint.manifest.provenance["data"] == data.name
    assert [each.name for each in checkpoint.manifest.classes] == ["ball", "line", "field", "environment"]


def test_at_a_terminal_the_bar_shows_epoch_loss_and_validation(data, configuration, tmp_path):
    main, terminal = pty.openpty()
    command = [*COMMAND, data, "-o", tmp_path / "run", "--config", configuration]
    with subprocess.Popen(
        list(map(str, command)), stdout=subprocess.DEVNULL, stderr=terminal, env=environment()
    ) as process:
        os.close(terminal)
        shown = b""
        with suppress(OSError):  # the end of a terminal whose program has ended
            while part := os.read(main, 4096):
                shown += part
    os.close(main)
    assert process.returncode == 0
    assert re.search(rb"left, epoch 1, loss \d\.\d{3}\x1b", shown)
    assert re.search(rb"left, epoch 3, loss \d\.\d{3}, validation AP \d\.\d{3}\x1b", shown)


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
    assert same_network(tmp_path / "run" / "model.pt", whole[0] / "model.pt")
    assert same_network(tmp_path / "run" / "round2.pt", whole[0] / "round2.pt")


@pytest.mark.parametrize(
    ("how", "steps"),
    [
        (signal.SIGINT, 2),
        (signal.SIGTERM, 9),
        (signal.SIGKILL, 9),
        (signal.SIGKILL, 24),
    ],
)
def test_what_is_stopped_at_any_moment_ends_with_the_same_weights(how, steps, whole, data, configuration, tmp_path):
    folder = tmp_path / "run"
    run_and_stop(how, folder, "log.jsonl", steps, data, "--config", configuration, "--workers", 1, "--threads", 1)
    run("resume", folder, "--workers", 1, "--threads", 1)
    for name in ("model.pt", "round1.pt", "round2.pt"):
        assert same_network(folder / name, whole[0] / name)
    assert (folder / "log.jsonl").read_text() == (whole[0] / "log.jsonl").read_text()


def test_a_reader_that_leaves_loses_no_training(data, configuration, tmp_path):
    """As in vm-train DATA -o RUN | head -1: no traceback, and the training is finished or can be resumed."""
    folder = tmp_path / "run"
    arguments = [*COMMAND, data, "-o", folder, "--config", configuration, "--workers", "1", "--threads", "1"]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([str(each) for each in arguments], text=True, env=environment(), **streams) as process:
        wait_for_steps(folder / "log.jsonl", 2, process)
        process.stdout.close()
        error = process.stderr.read()
        assert process.wait(120) == 130
    said = "vm-train: stopped, because nothing reads its output; continue with vm-train resume"
    assert error.splitlines()[-1] == f"{said} {folder}"
    assert "Traceback" not in error
    run("resume", folder, "--workers", 1, "--threads", 1)
    assert (folder / "model.pt").exists()


def test_two_processes_have_the_same_loss_curve_on_imported_pictures(whole, data, configuration, tmp_path):
    subprocess.run(["tar", "-cf", tmp_path / "data.tar", "-C", data.parent, data.name], check=True)
    unpacked = tmp_path / "data"
    run("import", tmp_path / "data.tar", unpacked)
    command = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node=2", "--master-port=0", "--standalone"]
    done = subprocess.run(
        [*command, "-m", "vm_train", unpacked, "-o", tmp_path / "run", "--config", configuration, "--workers", "0"],
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
        [record[VALIDATION] for _, record in read_log(folder / "log.jsonl") if VALIDATION in record]
        for folder in (whole[0], tmp_path / "run")
    ]
    assert scores[1] == pytest.approx(scores[0], abs=0.02)


def test_a_finished_training_says_so_and_a_begun_one_is_not_begun_again(whole, data, configuration):
    folder, _ = whole
    assert "finished already" in run("resume", folder).stdout
    again = run(data, "-o", folder, "--config", configuration, code=1)
    assert f"vm-train resume {folder}" in again.stderr


def copied(whole, tmp_path):
    return Path(shutil.copytree(whole[0], tmp_path / "run"))


def test_a_configuration_that_was_edited_is_refused(whole, tmp_path):
    folder = copied(whole, tmp_path)
    path = folder / "train.toml"
    path.write_text(path.read_text().replace("epochs = 3", "epochs = 5"))
    assert "train.toml was changed" in run("resume", folder, code=1).stderr


def test_a_training_in_work_is_left_alone(whole, tmp_path):
    folder = copied(whole, tmp_path)
    with locked(folder):
        assert f"another process is training in {folder}" in run("resume", folder, code=1).stderr


def test_two_trainings_do_not_begin_in_one_folder(data, configuration, tmp_path):
    with locked(tmp_path / "run"):
        done = run(data, "-o", tmp_path / "run", "--config", configuration, code=1)
        assert f"another process is training in {tmp_path / 'run'}" in done.stderr
        assert not list((tmp_path / "run").iterdir())
    assert not (tmp_path / "run").exists()


def test_an_empty_folder_of_the_user_stays(data, configuration, tmp_path):
    (tmp_path / "own").mkdir()
    for folder in ("own", "new"):
        run(data / "nothing", "-o", tmp_path / folder, "--config", configuration, code=1)
    assert (tmp_path / "own").is_dir()
    assert not (tmp_path / "new").exists()


def test_files_of_others_are_not_written_over(data, configuration, tmp_path):
    (tmp_path / "train.toml").write_text("# mine\n" + configuration.read_text())
    done = run(data, "-o", tmp_path, "--config", tmp_path / "train.toml", code=1)
    assert "holds train.toml, which a training would overwrite" in done.stderr
    assert (tmp_path / "train.toml").read_text().startswith("# mine")


def test_a_training_goes_on_where_its_folders_were_moved_to(whole, data, tmp_path):
    folder = copied(whole, tmp_path)
    (folder / "state.pt").unlink()
    (folder / "unpacked").mkdir()
    (folder / "unpacked" / "own.raw").write_bytes(b"camera")
    moved = Path(shutil.copytree(data, tmp_path / "moved"))
    run("resume", folder, "--data", moved, "--workers", 1, "--threads", 1)
    assert same_network(folder / "model.pt", whole[0] / "model.pt")
    assert not (whole[0] / "unpacked").exists()
    assert contents(folder / "unpacked") == {"own.raw": b"camera"}


def test_a_damaged_log_is_cut_where_it_is_damaged(whole, tmp_path):
    folder = copied(whole, tmp_path)
    (folder / "state.pt").unlink()
    with (folder / "log.jsonl").open("a") as file:
        file.write("\0\0\n")
    run("resume", folder, "--workers", 1, "--threads", 1)
    assert (folder / "log.jsonl").read_text() == (whole[0] / "log.jsonl").read_text()
