"""vm-train look --start: a training that begins with a trained look network."""

import json
import re

import pytest
import torch

from tests.vm_train.commands import run
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_weights import looks_of
from vm_train.cli.train import main
from vm_train.look.start import LookStart
from vm_train.runs.log import read_log

STILL = ["--set", "training.rate=1e-9", "--set", "training.decay=0", "--set", "training.epochs=1"]
"""A training that hardly changes a weight."""


@pytest.fixture(scope="module")
def trained(drawn, tiny, tmp_path_factory):
    """A look network from random weights."""
    folder = tmp_path_factory.mktemp("trained") / "run"
    run("look", drawn, "-o", folder, "--from", "ball", "--config", tiny, "--workers", 1)
    return folder / "look.pt"


@pytest.fixture(scope="module")
def go_on(drawn, tmp_path_factory):
    """Begins a training with a look network, by default one that changes nothing, and returns its folder."""

    def begin(start, *arguments):
        folder = tmp_path_factory.mktemp("further") / "run"
        given = ["--from", "ball", "--start", start, "--workers", 1, "--set", "data.validation=0.25"]
        run("look", drawn, "-o", folder, *given, *(arguments or STILL))
        return folder

    return begin


@pytest.fixture(scope="module")
def further(trained, go_on):
    """The folder of a training that changed nothing."""
    return go_on(trained)


def test_it_begins_with_the_weights_of_the_network(trained, further):
    """Its layers and patches come from there, too."""
    made, before = LookCheckpoint.load(further / "look.pt"), LookCheckpoint.load(trained)
    assert (made.contract.size, made.contract.channels) == (16, (4, 6, 8))
    assert made.network.shape == before.network.shape
    for name, weights in made.network.named_parameters():
        assert torch.allclose(weights, before.network.get_parameter(name), atol=1e-3), name
    losses = [record["loss"] for _, record in read_log(trained.with_name("log.jsonl")) if "loss" in record]
    (loss, *_) = [record["loss"] for _, record in read_log(further / "log.jsonl") if "loss" in record]
    assert loss < losses[0]


def test_the_network_gets_a_calibration_of_its_own(trained, further, go_on, tmp_path):
    """The scale and the offset of the network that it began with change nothing."""
    LookCheckpoint.load(trained).recalibrated(3.0, 1.0, "a test").save(tmp_path / "look.pt")
    first, second = (LookCheckpoint.load(each / "look.pt") for each in (further, go_on(tmp_path / "look.pt")))
    assert torch.equal(first.network.calibration, second.network.calibration)


def test_its_rate_is_lower_unless_something_else_is_given(trained, go_on):
    folder = go_on(trained, "--set", "training.epochs=1")
    assert "rate = 0.005" in (folder / "look.toml").read_text()


def test_a_start_that_was_changed_stops_the_training(further):
    path = further / "start.pt"
    content = path.read_bytes()
    path.write_bytes(content[:-1])
    try:
        assert re.search(r"start.pt was changed since the training began", run("resume", further, code=1).stderr)
    finally:
        path.write_bytes(content)


def test_its_provenance_tells_what_it_began_with(further):
    begun = json.loads((further / "run.json").read_text())["made_from"]
    provenance = LookCheckpoint.load(further / "look.pt").contract.provenance
    assert provenance["start_sha256"] == begun["start.pt"]


@pytest.mark.parametrize("name", ["ball", "goal", "robot"])
def test_of_a_model_file_it_takes_the_look_at_the_class(name):
    looks = {each.contract.object_class: each for each in looks_of(read_model(model_path("soccer")))}
    start = LookStart.load(model_path("soccer"), name)
    assert start.look.contract == looks[name].contract
    defaults = start.defaults["patches"]
    assert defaults["object_class"] == name
    assert defaults.get("upright_radius", 0.0) == looks[name].contract.upright_radius


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--start", "bal"], "unknown network 'bal'; did you mean 'ball'?"),
        (["--start", "none.pt"], "can't read none.pt"),
        (["--start", "ball", "--set", "patches.size=16"], "16 x 16 samples"),
        (["--start", "ball", "--set", "patches.extent=2"], "patches.extent 1.75"),
        (["--start", "ball", "--set", "patches.object_class=robot"], "unknown close look of"),
    ],
)
def test_what_cannot_work_ends_in_one_line(arguments, said, drawn, tmp_path, capsys):
    given = ["look", drawn, "-o", tmp_path / "run", "--from", "ball", *arguments]
    assert main([str(each) for each in given]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
