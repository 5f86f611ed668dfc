"""A teacher: a trained network that a new one learns from."""

import hashlib

import pytest
import torch

from tests.vm_train.commands import run
from vm_export.checkpoint import Checkpoint


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
        checkpoint.network.typed_layers[0].linear.bias += 1.0
    checkpoint.save(path)


@pytest.mark.long
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
def test_a_teacher_of_another_mesh_or_without_a_file_is_refused(one, data, configuration, tmp_path):
    settings = ("--config", configuration, "--set", "mesh.intersections=5")
    refused = run(data, "-o", tmp_path / "run", "--teacher", one / "model.pt", *settings, code=1)
    assert "was trained with another intersections: 4" in refused.stderr
    flat = ("--config", configuration, "--set", "mesh.grid=hexagonal")
    refused = run(data, "-o", tmp_path / "run", "--teacher", one / "model.pt", *flat, code=1)
    assert "was trained with another grid: Grid(kind='visual', equal_at=0.0), not" in refused.stderr
    missing = run(data, "-o", tmp_path / "run", "--teacher", tmp_path / "no.pt", "--config", configuration, code=1)
    assert "can't read" in missing.stderr
    assert not (tmp_path / "run").exists()
