"""vm-train shifts: least squares finds the shifts, from real pictures too, and what a user types works."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.vm_train.commands import run
from tests.vm_train.drawn import draw_set
from tests.vm_train.weights import same, weights_of
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_export.checkpoint import Checkpoint
from vm_export.network_weights import network_of
from vm_train.data.pictures import find_pictures
from vm_train.evaluation.evaluation import Rules
from vm_train.evaluation.mask_colors import classes_with_colors, default_colors
from vm_train.evaluation.workers import Job, evaluate
from vm_train.look.shifts import ShiftFit

FITTED = re.compile(r"(\d+) points on (\d+) objects of class ball: ([\d.]+) instead of ([\d.]+) radii from the center")

_FEW = 8
"""Proposals per picture for networks with and without shifts: more of them are nearer to the centers."""


@given(st.integers(0, 10**6), st.integers(1, 6), st.integers(1, 5))
@settings(max_examples=50)
def test_shifts_that_are_linear_in_the_fields_are_found(seed, entries, parts):
    """In whatever parts the points come; an entry that is the same for all points does no harm."""
    random = np.random.default_rng(seed)
    fields = random.normal(size=(40 * (entries + 2), entries + 1))
    fields[:, -1] = 3.0
    weights = random.normal(size=(entries + 1, 2))
    shifts = fields @ weights + 0.25
    fit = ShiftFit.empty(entries + 1)
    for rows in np.array_split(np.arange(len(fields)), parts):
        fit.add(fields[rows].astype(np.float32), shifts[rows])
    found = fit.weights()
    np.testing.assert_allclose(fields @ found[:-1] + found[-1], shifts, atol=1e-2)
    before, after = fit.errors
    assert before == pytest.approx(float(np.sqrt((shifts**2).sum(axis=1).mean())), rel=1e-6)
    assert after < 1e-2


def test_the_error_is_that_of_the_points():
    random = np.random.default_rng(0)
    fields, shifts = random.normal(size=(300, 3)).astype(np.float32), random.normal(size=(300, 2))
    fit = ShiftFit.empty(3)
    fit.add(fields, shifts)
    left = fields @ fit.weights()[:-1] + fit.weights()[-1] - shifts
    assert fit.errors[1] == pytest.approx(float(np.sqrt((left**2).sum(axis=1).mean())), rel=1e-5)


def test_too_few_points_are_refused():
    fit = ShiftFit.empty(3)
    fit.add(np.ones((39, 3), np.float32), np.ones((39, 2)))
    with pytest.raises(InputError, match="39 points on 0 objects are too few for 4 weights, which need 40"):
        fit.weights()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Sixty drawn pictures, larger than usual: their balls have more pixels."""
    return draw_set(tmp_path_factory.mktemp("drawn"), 60, size=(320, 256))


@pytest.fixture(scope="module")
def shifted(folder, tmp_path_factory):
    """The network ball-small with shifts, and what the command said."""
    path = tmp_path_factory.mktemp("shifted") / "ball.onnx"
    return path, run("shifts", "ball-small", folder, "-o", path).stdout


def test_proposals_are_nearer_to_the_centers(shifted, folder):
    path, said = shifted
    points, objects, after, before = map(float, FITTED.search(said).groups())
    assert (points > 500, 40 < objects < 60) == (True, True)
    assert after < 0.7 * before
    near = []
    for model in (model_path("ball-small"), path):
        classes = classes_with_colors(read_model(model).manifest, default_colors(model, None), [])
        job = Job(model, Settings(max_proposals=_FEW), False, classes, Rules("scene"))
        scores = evaluate(job, job.subject(), find_pictures(folder), 1, lambda: None).proposals["ball"]
        near.append(float(np.median([each.offset for each in scores._truths])))
    assert near[1] < 0.8 * near[0]


def test_a_checkpoint_gets_the_same_shifts_as_its_model_file(shifted, folder, tmp_path):
    network_of(read_model(model_path("ball-small"))).save(tmp_path / "bare.pt")
    run("shifts", tmp_path / "bare.pt", folder, "-o", tmp_path / "shifted.pt", "--class", "ball")
    found, expected = Checkpoint.load(tmp_path / "shifted.pt"), network_of(read_model(shifted[0]))
    assert found.manifest.shifts == "ball"
    for name, each in found.network.state_dict().items():
        np.testing.assert_allclose(each.numpy(), expected.network.state_dict()[name].numpy(), atol=1e-3)
    # A fit replaces shifts that are there.
    run("shifts", tmp_path / "shifted.pt", folder, "-o", tmp_path / "again.pt")
    assert same(weights_of(tmp_path / "again.pt"), weights_of(tmp_path / "shifted.pt"))


def test_a_training_goes_on_without_the_shifts_and_a_look_learns_from_the_shifted_proposals(
    shifted, drawn, tiny, tmp_path
):
    settings = ("--set", "training.epochs=1", "--workers", 0, "--threads", 1, "--no-unpacked")
    run(drawn, "-o", tmp_path / "further", "--from", shifted[0], *settings)
    assert Checkpoint.load(tmp_path / "further" / "model.pt").manifest.shifts is None
    run("look", drawn, "--from", shifted[0], "-o", tmp_path / "look", "--config", tiny, "--workers", 1)
    assert (tmp_path / "look" / "look.pt").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["ball-smal"], "ball-small"),
        (["ball-small", "--class", "bal"], "unknown class of kind object 'bal'; did you mean 'ball'"),
        (["ball-small", "-o", "new.pt"], "new.pt must end in .onnx, as "),
        (["none.pt", "-o", "new.pt"], "none.pt"),
    ],
)
def test_mistakes_are_told_in_a_line(arguments, said, folder, tmp_path):
    output = [] if "-o" in arguments else ["-o", tmp_path / "new.onnx"]
    done = run("shifts", *arguments[:1], folder, *arguments[1:], *output, code=1)
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_too_few_pictures_and_damaged_ones_are_told(tmp_path):
    draw_set(tmp_path / "data", 3)
    (tmp_path / "data" / "mask0001.png").write_bytes(b"no picture")
    done = run("shifts", "ball-small", tmp_path / "data", "-o", tmp_path / "new.onnx", code=1)
    assert "vm-train: picture 0001: " in done.stderr
    assert "are too few for 57 weights, which need 570: give more pictures" in done.stderr
    assert not (tmp_path / "new.onnx").exists()
