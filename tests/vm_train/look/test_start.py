"""vm-train look --start: a training that begins with a trained look network."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from tests.vm_train.commands import run
from vm_embedded.config.sections import read_sections
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_weights import look_of, upright_looks_of
from vm_train.cli.train import main
from vm_train.look.configuration import LookConfiguration
from vm_train.look.start import LookStart
from vm_train.runs.log import read_log

STILL = ["--set", "training.rate=1e-9", "--set", "training.decay=0", "--set", "training.epochs=1"]
"""A training that hardly changes a weight."""


@pytest.fixture(scope="module")
def trained(drawn, tiny, tmp_path_factory):
    """A look network from random weights."""
    folder = tmp_path_factory.mktemp("trained") / "run"
    run("look", drawn, "-o", folder, "--from", "ball-small", "--config", tiny, "--workers", 1)
    return folder / "look.pt"


@pytest.fixture(scope="module")
def go_on(drawn, tmp_path_factory):
    """Begins a training with a look network, by default one that changes nothing, and returns its folder."""

    def begin(start, *arguments):
        folder = tmp_path_factory.mktemp("further") / "run"
        given = ["--from", "ball-small", "--start", start, "--workers", 1, "--set", "data.validation=0.25"]
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


def test_its_glance_goes_before_the_new_network(trained, go_on, tmp_path):
    look = LookCheckpoint.load(trained)
    replace(look, contract=replace(look.contract, glance=look.contract), glance=look).save(tmp_path / "look.pt")
    made = LookCheckpoint.load(go_on(tmp_path / "look.pt") / "look.pt")
    assert made.contract.glance == look.contract


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


@pytest.mark.parametrize(("name", "number"), [("ball", None), ("goal", 0), ("robot", 1)])
def test_of_a_model_file_it_takes_the_look_at_the_class(name, number):
    model = read_model(model_path("soccer"))
    uprights = {each.contract.object_class: each for each in upright_looks_of(model)}
    expected = look_of(model) if number is None else uprights[name]
    start = LookStart.load(model_path("soccer"), name)
    assert start.look.contract == expected.contract
    defaults = start.defaults["patches"]
    assert defaults["object_class"] == name
    assert defaults.get("upright_radius", 0.0) == expected.contract.upright_radius


def test_the_recipe_of_the_package_goes_on_from_its_network():
    start = LookStart.load(model_path("soccer"), "robot")
    recipe = Path(__file__).parents[3] / "export" / "networks" / "robot-further.toml"
    start.check(read_sections(LookConfiguration, recipe, defaults=start.defaults))
    assert recipe.name in model_path("soccer").with_suffix(".md").read_text()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--start", "bal"], "unknown network 'bal'; did you mean 'ball'?"),
        (["--start", "none.pt"], "can't read none.pt"),
        (["--start", "ball", "--set", "patches.size=16"], "16 x 16 samples"),
        (["--start", "ball", "--set", "patches.extent=2"], "patches.extent 4"),
        (["--start", "ball", "--set", "patches.object_class=robot"], "unknown close look of"),
        (["--glance", "ball"], "--glance has 3 networks, and the new one would be another: give one with at most 2"),
    ],
)
def test_what_cannot_work_ends_in_one_line(arguments, said, drawn, tmp_path, capsys):
    given = ["look", drawn, "-o", tmp_path / "run", "--from", "ball-small", *arguments]
    assert main([str(each) for each in given]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
