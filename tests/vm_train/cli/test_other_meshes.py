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
@pytest.mark.parametrize(
    ("model", "layouts"),
    [
        ("cap6", ("plain", "runs")),
        ("xmgrid8", ("plain", "runs")),
        ("wall6", ("plain", "runs")),
    ],
)
def test_trained_exported_and_run(model, layouts, data, tmp_path):
    """Every layout of the file gives the same answers on the pictures."""
    text = KINDS + UPRIGHT + SMALL[SMALL.index("[network]") :] if model == "wall6" else CLASSES + SMALL
    (tmp_path / "train.toml").write_text(text)
    common = ("--config", tmp_path / "train.toml", "--workers", 1, "--threads", 1, "--set", f"mesh.model={model}")
    run(data, "-o", tmp_path / "run", *common)
    answers = []
    for layout in layouts:
        file = tmp_path / f"{layout}.onnx"
        run_module("vm_export.cli", tmp_path / "run/model.pt", "-o", file, "--layout", layout)
        done = run_module(
            "vm_embedded.cli.detect", "--model", file, "--camera", data, "--threshold", 0.2, "--emit-points", "field"
        )
        answers.append([json.loads(line) for line in done.stdout.splitlines()])
    assert len(answers[0]) == 12
    assert sum(each["points"] for each in answers[0]) > 1000
    for other in answers[1:]:
        for one, again in zip(answers[0], other, strict=True):
            assert one["points"] == again["points"]
            assert one["detections"] == again["detections"]
