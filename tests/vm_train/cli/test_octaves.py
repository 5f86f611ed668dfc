"""A network on mesh octaves from a configuration to detections, with commands as a user types them."""

import json
import shutil
import signal

import numpy as np
import pytest

from tests.vm_train.commands import run, run_and_stop, run_module
from tests.vm_train.drawn import CLASSES
from tests.vm_train.weights import same, weights_of
from vm_export.canvas_shape import CanvasShape
from vm_export.checkpoint import Checkpoint
from vm_train.runs.log import read_log

OCTAVES = """
[mesh]
model = "octaves"
radius = 0.07
max_distance = 4.0
intersections = 2
[network]
depth = 1
width = 8
[training]
epochs = 3
repeats = 2
batch = 4
optimizer = "muon"
rate = 0.02
mirrored = 0.5
window = 0.7
selection = "weighted"
"""
ONE = ("--workers", 0, "--threads", 1)


@pytest.fixture(scope="module")
def octaves(tmp_path_factory):
    path = tmp_path_factory.mktemp("octaves") / "train.toml"
    path.write_text(CLASSES + OCTAVES)
    return path


@pytest.fixture(scope="module")
def trained(data, octaves, tmp_path_factory):
    """A training that nobody disturbs."""
    folder = tmp_path_factory.mktemp("trained") / "run"
    run(data, "-o", folder, "--config", octaves, *ONE)
    return folder


def losses_of(folder):
    return [record["loss"] for _, record in read_log(folder / "log.jsonl") if "loss" in record]


def test_it_learns_is_exported_and_detects(trained, data, tmp_path):
    losses = losses_of(trained)
    tenth = len(losses) // 10
    assert np.mean(losses[-tenth:]) < 0.6 * np.mean(losses[:tenth])
    assert Checkpoint.load(trained / "model.pt").network.shape == CanvasShape(1, 8, 4, 1)
    run_module("vm_export.cli", trained / "model.pt", "-o", tmp_path / "model.onnx")
    done = run_module(
        "vm_embedded.cli.detect", "--model", tmp_path / "model.onnx", "--camera", data, "--emit-points", "field"
    )
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == 30
    assert min(each["points"] for each in found) > 100


@pytest.mark.long
@pytest.mark.parametrize("steps", [2, 15])
def test_what_is_killed_at_any_moment_ends_with_the_same_weights(steps, trained, data, octaves, tmp_path):
    folder = tmp_path / "run"
    run_and_stop(signal.SIGKILL, folder, "log.jsonl", steps, data, "--config", octaves, *ONE)
    run("resume", folder, *ONE)
    assert same(weights_of(folder / "model.pt"), weights_of(trained / "model.pt"))
    assert (folder / "log.jsonl").read_text() == (trained / "log.jsonl").read_text()


@pytest.mark.long
def test_it_is_trained_further_from_its_checkpoint_and_from_its_model_file(trained, data, tmp_path):
    """Mesh and shape come from the network; it begins about as well as the first training ended."""
    run_module("vm_export.cli", trained / "model.pt", "-o", tmp_path / "model.onnx")
    (tmp_path / "classes.toml").write_text(CLASSES)
    settings = (
        "--config",
        tmp_path / "classes.toml",
        "--set",
        "training.epochs=1",
        "--set",
        "training.rate=1e-3",
        *ONE,
    )
    for start in (trained / "model.pt", tmp_path / "model.onnx"):
        folder = tmp_path / start.suffix.removeprefix(".")
        run(data, "-o", folder, "--from", start, *settings)
        assert Checkpoint.load(folder / "model.pt").network.shape == CanvasShape(1, 8, 4, 1)
    wrong = run(
        data, "-o", tmp_path / "w", "--from", trained / "model.pt", *settings, "--set", "network.width=16", code=1
    )
    assert "depth 1 and width 8 on octaves" in wrong.stderr


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("network.activation=relu", "activation"),
        ("network.kind=separable", "kind"),
        ("network.width=20", "16"),
        ("mesh.grid=hexagonal", "hexagonal"),
    ],
)
def test_entries_without_effect_and_wrong_widths_are_refused(entry, said, data, octaves, tmp_path):
    done = run(data, "-o", tmp_path / "run", "--config", octaves, "--set", entry, code=1)
    assert said in done.stderr
    assert done.stderr.startswith("vm-train: ")
    assert not (tmp_path / "run").exists()


@pytest.mark.long
def test_pictures_that_leave_bases_unknown_are_a_remark(data, tmp_path):
    shutil.copytree(data, tmp_path / "data")
    for scene in sorted((tmp_path / "data").glob("scene*.json"))[:4]:
        scene.unlink()
    path = tmp_path / "train.toml"
    posts = CLASSES.replace('line = { kind = "area"', 'goal = { kind = "upright"')
    path.write_text(posts + OCTAVES.replace("epochs = 3\nrepeats = 2", "epochs = 1"))
    done = run(tmp_path / "data", "-o", tmp_path / "run", "--config", path, *ONE)
    assert "vm-train: 4 pictures have no sceneX.json: from them, the network does not learn" in done.stderr
    assert "the base of a goal" in done.stderr
    shape = Checkpoint.load(tmp_path / "run" / "model.pt").network.shape
    assert (shape.classes, shape.peaks) == (4, 2)
