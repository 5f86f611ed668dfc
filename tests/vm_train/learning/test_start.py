"""Trainings that begin with the weights of a trained network."""

import hashlib
import shutil
from dataclasses import replace

import pytest
import torch

from tests.vm_export.checkpoints import manifest
from tests.vm_train.commands import run
from tests.vm_train.drawn import CLASSES
from tests.vm_train.weights import weights_of
from vm_embedded.config.sections import read_sections
from vm_embedded.errors import InputError
from vm_embedded.network.bundled import SHIPPED, model_path
from vm_embedded.network.manifest import ObjectClass
from vm_export.checkpoint import Checkpoint
from vm_export.export import export
from vm_export.network import Network
from vm_export.network_shape import Layer, NetworkShape
from vm_train.learning.configuration import TrainConfiguration
from vm_train.learning.start import Start

ONE_EPOCH = ("--set", "training.epochs=1", "--workers", 0, "--threads", 1, "--no-unpacked")
STILL = ("--set", "training.rate=1e-9", "--set", "training.decay=0")


@pytest.fixture(scope="module")
def first(data, configuration, tmp_path_factory):
    """A training from random weights."""
    folder = tmp_path_factory.mktemp("first") / "run"
    run(data, "-o", folder, "--config", configuration, *ONE_EPOCH)
    return folder / "model.pt"


@pytest.mark.long
def test_with_a_tiny_rate_the_network_stays_the_same_from_a_checkpoint_and_from_its_model_file(first, data, tmp_path):
    export(Checkpoint.load(first), tmp_path / "model.onnx")
    tables = tmp_path / "classes.toml"
    tables.write_text(CLASSES)  # the mesh and the layers come from the network
    for start in (first, tmp_path / "model.onnx"):
        folder = tmp_path / start.suffix.removeprefix(".")
        run(data, "-o", folder, "--from", start, "--config", tables, *ONE_EPOCH, *STILL)
        made, before = weights_of(folder / "model.pt"), weights_of(first)
        assert made.keys() == before.keys()
        differences = [float((made[name] - before[name]).abs().max()) for name in before if "layers.2" not in name]
        assert max(differences) < 1e-5
        copy = folder / f"start{start.suffix}"
        digest = hashlib.sha256(start.read_bytes()).hexdigest()
        assert hashlib.sha256(copy.read_bytes()).hexdigest() == digest
        assert Checkpoint.load(folder / "model.pt").manifest.provenance["start_sha256"] == digest
    assert Checkpoint.load(first).manifest.provenance["start_sha256"] == "none"


@pytest.mark.long
def test_a_stopped_training_goes_on_from_the_copy_to_the_same_bytes(first, data, configuration, tmp_path):
    start = tmp_path / "mine.pt"
    shutil.copy(first, start)
    settings = ("--from", start, "--config", configuration, *ONE_EPOCH)
    run(data, "-o", tmp_path / "whole", *settings)
    stopped = tmp_path / "stopped"
    run(data, "-o", stopped, *settings)
    for name in ("state.pt", "model.pt", "round1.pt", "log.jsonl"):  # as if killed before the first step
        (stopped / name).unlink()
    start.unlink()
    run("resume", stopped, "--workers", 0, "--threads", 1)
    assert (stopped / "model.pt").read_bytes() == (tmp_path / "whole" / "model.pt").read_bytes()
    made, before = weights_of(stopped / "model.pt"), weights_of(first)
    assert any(not torch.equal(made[name], before[name]) for name in made)

    changed = Checkpoint.load(stopped / "start.pt")
    with torch.no_grad():
        changed.network.typed_layers[0].linear.bias += 1.0
    changed.save(stopped / "start.pt")
    refused = run("resume", stopped, code=1)
    assert "start.pt was changed since the training began" in refused.stderr


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("mesh.intersections=5", "was trained with another intersections: 4.0, not 5"),
        ("network.width=6", "has other layers: [convolution 4 selu, convolution 4 selu, convolution 4 softmax] with 6"),
        ("mesh.grid=hexagonal", "was trained with another grid: Grid(kind='visual', equal_at=0.0), not"),
    ],
)
def test_what_differs_is_named(entry, said, first, data, configuration, tmp_path):
    command = (data, "-o", tmp_path / "run", "--from", first, "--config", configuration, "--set", entry)
    assert said in run(*command, code=1).stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.long
def test_an_unknown_network_is_refused(data, tmp_path):
    assert "did you mean 'ball'?" in run(data, "-o", tmp_path / "run", "--from", "bal", code=1).stderr
    assert "can't read" in run(data, "-o", tmp_path / "run", "--from", tmp_path / "no.pt", code=1).stderr


@pytest.mark.parametrize("name", SHIPPED)
def test_the_networks_of_the_package_describe_their_training(name):
    start = Start.load(model_path(name))
    found = read_sections(TrainConfiguration, None, {"training": {"epochs": 2}}, defaults=start.defaults)
    start.check(found)
    assert (found.training.rate, found.training.epochs) == (0.001, 2)
    assert found.mesh.radius_of == "scene"
    colors = [color for each in found.classes.colors.values() for color in each]
    assert sorted(colors) == sorted(color for each in TrainConfiguration().classes.colors.values() for color in each)


def test_classes_of_unknown_colors_and_layers_of_several_kinds_need_a_configuration(tmp_path):
    shape = NetworkShape((Layer("convolution", 4, "selu"), Layer("dense", 2, "softmax")))
    classes = (ObjectClass("cup", "object"), ObjectClass("table", "background"))
    path = tmp_path / "cup.pt"
    Checkpoint(Network(shape), replace(manifest(), classes=classes)).save(path)
    start = Start.load(path)
    with pytest.raises(InputError, match="cup: colors must be a list of colors"):
        read_sections(TrainConfiguration, None, defaults=start.defaults)
    colors = {"cup": {"kind": "object", "colors": [[1, 2, 3]]}, "table": {"kind": "background", "colors": [[0, 0, 0]]}}
    found = read_sections(TrainConfiguration, None, {"classes": colors}, defaults=start.defaults)
    with pytest.raises(InputError, match=r"has other layers: \[convolution 4 selu, dense 2 softmax\]"):
        start.check(found)


def test_a_configuration_goes_before_what_the_network_describes(tmp_path):
    path = tmp_path / "train.toml"
    path.write_text("[mesh]\nmax_distance = 6\n[training]\nrate = 0.002\n")
    start = Start.load(model_path("ball"))
    found = read_sections(TrainConfiguration, path, {"training": {"epochs": 2}}, defaults=start.defaults)
    assert (found.mesh.max_distance, found.mesh.intersections) == (6, 3)
    assert (found.training.rate, found.training.epochs) == (0.002, 2)
    start.check(found)  # a mesh may reach less far
    path.write_text("mesh = 3\n")
    with pytest.raises(InputError, match=r"mesh must be a section, \[mesh\], not 3"):
        read_sections(TrainConfiguration, path, defaults=start.defaults)
