"""Networks that have a part in the training of another: one that looks first, and one that teaches."""

import hashlib
import json
import subprocess
import sys

import pytest
import torch

from tests.vm_train.commands import SMALL, environment, run
from tests.vm_train.drawn import CLASSES, draw_set
from vm_export.checkpoint import Checkpoint


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return draw_set(tmp_path_factory.mktemp("drawn"), 30)


@pytest.fixture(scope="module")
def configuration(tmp_path_factory):
    path = tmp_path_factory.mktemp("configuration") / "train.toml"
    path.write_text(CLASSES + SMALL.replace('"hard"', '"all"'))
    return path


@pytest.fixture(scope="module")
def one(data, configuration, tmp_path_factory):
    """A training of a network that stands alone."""
    folder = tmp_path_factory.mktemp("one") / "run"
    run(data, "-o", folder, "--config", configuration, "--workers", 0, "--threads", 1)
    return folder


def change(path):
    """Give a checkpoint other weights."""
    checkpoint = Checkpoint.load(path)
    with torch.no_grad():
        checkpoint.last_network.typed_layers[0].linear.bias += 1.0
    checkpoint.save(path)


@pytest.mark.long
def test_a_second_look_is_trained_on_what_the_first_passes_on(one, data, configuration, tmp_path):
    """Whether views are kept or not, and however it is stopped; the file holds both networks, and is evaluated."""
    first = one / "model.pt"
    settings = ("--config", configuration, "--set", "second_look.above=0.3")
    arguments = (data, "--first", first, "--workers", 0, "--threads", 1, *settings)
    done = run(*arguments, "-o", tmp_path / "run", "--set", "training.views=2")
    assert "average precision" in done.stdout
    made = Checkpoint.load(tmp_path / "run" / "model.pt")
    there = Checkpoint.load(first).network.state_dict()
    assert all(torch.equal(made.network.first.state_dict()[name], there[name]) for name in there)
    assert (made.network.gate.above, made.network.gate.rings, made.network.gate.classes) == (0.3, 4, (0,))
    seen = json.loads((tmp_path / "run" / "run.json").read_text())["points"]
    everything = json.loads((one / "run.json").read_text())["points"]
    assert 0 < sum(seen.values()) < sum(everything.values())

    report = [
        sys.executable,
        "-m",
        "vm_train.cli.evaluate",
        tmp_path / "run" / "model.pt",
        data,
        "-o",
        tmp_path / "report",
    ]
    subprocess.run([str(each) for each in report], check=True, capture_output=True, timeout=240, env=environment())

    change(tmp_path / "run" / "first.pt")
    refused = run("resume", tmp_path / "run", code=1)
    assert "first.pt was changed since the training began" in refused.stderr


def test_a_network_that_can_t_look_first_is_named(one, data, configuration, tmp_path):
    settings = ("--config", configuration, "--set", "mesh.radius=0.08")
    refused = run(data, "-o", tmp_path / "run", "--first", one / "model.pt", *settings, code=1)
    assert "was trained with another radius: 0.07, not 0.08" in refused.stderr
    missing = run(data, "-o", tmp_path / "run", "--first", tmp_path / "no.pt", "--config", configuration, code=1)
    assert "can't read" in missing.stderr
    assert not (tmp_path / "run" / "run.json").exists()


def test_a_teacher_goes_along_and_changes_what_is_learned(one, data, configuration, tmp_path):
    teacher = tmp_path / "teacher.pt"
    teacher.write_bytes((one / "model.pt").read_bytes())
    settings = ("--config", configuration, "--workers", 0, "--threads", 1)
    run(data, "-o", tmp_path / "run", "--teacher", teacher, "--set", "training.distillation=0.9", *settings)
    made, alone = Checkpoint.load(tmp_path / "run" / "model.pt"), Checkpoint.load(one / "model.pt")
    assert made.manifest.provenance["teacher_sha256"] == hashlib.sha256(teacher.read_bytes()).hexdigest()
    assert alone.manifest.provenance["teacher_sha256"] == "none"
    there = alone.network.state_dict()
    assert not any(torch.equal(value, there[name]) for name, value in made.network.state_dict().items())

    teacher.unlink()
    assert "was finished already" in run("resume", tmp_path / "run").stdout
    change(tmp_path / "run" / "teacher.pt")
    refused = run("resume", tmp_path / "run", code=1)
    assert "teacher.pt was changed since the training began" in refused.stderr


@pytest.mark.long
def test_a_second_look_may_teach_a_single_network(one, data, configuration, tmp_path):
    settings = ("--config", configuration, "--workers", 0, "--threads", 1, "--set", "training.epochs=1")
    run(data, "-o", tmp_path / "large", "--first", one / "model.pt", *settings)
    done = run(data, "-o", tmp_path / "pupil", "--teacher", tmp_path / "large" / "model.pt", *settings)
    assert "average precision" in done.stdout
    refused = run(data, "-o", tmp_path / "no", "--first", tmp_path / "large" / "model.pt", *settings, code=1)
    assert "can't look first: it already has a second look" in refused.stderr


def test_a_teacher_of_another_mesh_is_refused(one, data, configuration, tmp_path):
    settings = ("--config", configuration, "--set", "mesh.intersections=5")
    refused = run(data, "-o", tmp_path / "run", "--teacher", one / "model.pt", *settings, code=1)
    assert "was trained with another intersections: 4" in refused.stderr
    flat = ("--config", configuration, "--set", "mesh.grid=hexagonal")
    refused = run(data, "-o", tmp_path / "run", "--teacher", one / "model.pt", *flat, code=1)
    assert "was trained with another grid: Grid(kind='visual', equal_at=0.0), not" in refused.stderr
    assert not (tmp_path / "run").exists()
