"""A network trained on another mesh than rings is exported and run, from commands as a user types them."""

import json

import pytest

from tests.vm_train.commands import run, run_module
from tests.vm_train.drawn import CLASSES, draw_set

SMALL = """
[mesh]
radius = 0.07
max_distance = 3.0
[network]
depth = 3
width = 4
[training]
epochs = 1
batch = 4
"""
UPRIGHT = """
[mesh]
shape = "cylinder"
radius = 0.07
object_height = 1.0
model = "wall6"
sampling = "bilinear"
max_distance = 3.0
"""
KINDS = CLASSES.replace('"object"', '"upright"')


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return draw_set(tmp_path_factory.mktemp("drawn"), 12)


@pytest.mark.long
@pytest.mark.parametrize("model", ["cap6", "xmgrid8", "wall6"])
def test_trained_exported_and_run(model, data, tmp_path):
    text = KINDS + UPRIGHT + SMALL[SMALL.index("[network]") :] if model == "wall6" else CLASSES + SMALL
    (tmp_path / "train.toml").write_text(text)
    common = ("--config", tmp_path / "train.toml", "--workers", 1, "--threads", 1, "--set", f"mesh.model={model}")
    run(data, "-o", tmp_path / "run", *common)
    run_module("vm_export.cli", tmp_path / "run/model.pt", "-o", tmp_path / "model.onnx")
    options = ("--camera", data, "--threshold", 0.2, "--emit-points", "field")
    done = run_module("vm_embedded.cli.detect", "--model", tmp_path / "model.onnx", *options)
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(answers) == 12
    assert sum(each["points"] for each in answers) > 1000
