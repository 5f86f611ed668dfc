"""vm-evaluate calibrate as a user types it: a model file whose confidence fits pictures."""

import json
import re
import shutil

import cv2
import numpy as np
import pytest

from tests.looks import random_patches, upright
from tests.vm_export.looks import look_checkpoint
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import CloseLook
from vm_export.change_model import change_look
from vm_export.look_weights import look_of
from vm_train.cli import evaluate_calibrate
from vm_train.cli.evaluate import main
from vm_train.scores.calibration import Calibration, logits_from
from vm_train.scores.object_ranking import Ranking

from ...drawn_scenes import MODEL
from ..drawn import draw_set

FITTED = re.compile(r"ball: (\d+) answers in 60 pictures; .* error ([\d.]+) before, ([\d.]+) after .*scale ([\d.]+), ")


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return draw_set(tmp_path_factory.mktemp("drawn"), 60)


def calibrate(*arguments):
    return main(["calibrate", *map(str, arguments), "--radius-of", "scene"])


@pytest.mark.long
def test_the_confidence_fits_the_pictures_afterward_and_all_else_stays(data, tmp_path, capsys):
    shipped = model_path("ball")
    unsure = look_of(read_model(shipped)).recalibrated("ball", 0.6, 0.3, "no picture")
    change_look(shipped, tmp_path / "unsure.onnx", unsure)
    assert calibrate(tmp_path / "unsure.onnx", data, "-o", tmp_path / "once.onnx") == 0
    _, before, after, scale = map(float, FITTED.search(capsys.readouterr().out).groups())
    assert after < before
    old, new = (read_model(tmp_path / f"{name}.onnx") for name in ("unsure", "once"))
    patches = random_patches(20, old.manifest.look.size)
    first, second = (CloseLook.of(each).run(patches)[:, 0] for each in (old, new))
    np.testing.assert_allclose(second[:, 1:], first[:, 1:], atol=1e-6)
    logits = [logits_from(each[:, 0].astype(np.float64)) for each in (first, second)]
    offset = logits[1][0] - scale * logits[0][0]
    np.testing.assert_allclose(logits[1], scale * logits[0] + offset, atol=0.05)  # the printed scale has two digits
    assert re.fullmatch(r"\d+ answers in 60 pictures", new.manifest.look.classes[0].calibrated_on)

    assert calibrate(tmp_path / "once.onnx", data, "-o", tmp_path / "twice.onnx") == 0
    again = float(FITTED.search(capsys.readouterr().out)[4])
    assert again == pytest.approx(1.0, abs=0.1)


BEST = {"ball": 0.8, "goal": 0.0, "robot": 1.6}
"""The weight of the scores of peaks with which each class is ranked best, in the test below."""


def ranking(name, weight):
    """What is found of a class with a weight: the nearer that is to the best one, the fewer of the surest are wrong."""
    wrong = round(10 * abs(weight - BEST[name]))
    right = np.array([False] * wrong + [True] * 20 + [False] * (40 - wrong))
    right[[1, 50]] = True
    confidence = np.linspace(0.95, 0.05, 60) ** (1 + list(BEST).index(name))
    return Ranking(confidence=confidence, right=right, truths=25, pictures=60)


class Found:
    """An evaluation of a model file that finds that."""

    poses = range(60)

    def __init__(self, job, *_):
        self.weights = {each.name: each.mesh_weight for each in read_model(job.model).manifest.look.classes}


def test_each_class_gets_the_weight_and_the_calibration_that_suit_it(data, tmp_path, monkeypatch):
    monkeypatch.setattr(evaluate_calibrate, "evaluate_with_progress", Found)
    monkeypatch.setattr(evaluate_calibrate, "_ranking", lambda result, name: ranking(name, result.weights[name]))
    before, after = tmp_path / "before.onnx", tmp_path / "after.onnx"
    change_look(model_path("soccer"), before, look_checkpoint(classes=("ball", upright("goal"), upright("robot"))))
    assert calibrate(before, data, "-o", after) == 0
    old, new = (read_model(path) for path in (before, after))
    patches = random_patches(20)
    first, second = (logits_from(CloseLook.of(each).run(patches)[..., 0].astype(np.float64)) for each in (old, new))
    for number, (name, weight) in enumerate(BEST.items()):
        best = ranking(name, weight)
        fitted = Calibration.fit(logits_from(best.confidence), best.right)
        np.testing.assert_allclose(second[:, number], fitted.scale * first[:, number] + fitted.offset, atol=1e-3)
        assert new.manifest.look.classes[number].mesh_weight == pytest.approx(fitted.scale * weight)
        assert new.manifest.look.classes[number].calibrated_on == "60 answers in 60 pictures"


@pytest.mark.long
def test_objects_of_another_size_and_a_calibration_that_does_not_help_are_told(data, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(Calibration, "fit", lambda logits, right: Calibration(1.0, 0.0))
    assert main(["calibrate", "ball", str(data), "-o", str(tmp_path / "own.onnx")]) == 0
    said = capsys.readouterr().err
    assert "have a radius of 0.070 m, but the detector expects 0.095 m. --radius-of scene" in said
    assert "class ball: the error is not smaller than before: give more pictures" in said


@pytest.mark.long
def test_a_canary_that_is_not_found_any_more_is_a_warning(data, tmp_path, capsys):
    """Most balls of these masks are said to be field, so the network becomes unsure of all balls."""
    shutil.copytree(data, tmp_path / "data")
    for path in sorted((tmp_path / "data").glob("mask*.png"))[15:]:
        mask = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        mask[(mask[..., :3] == (0, 0, 255)).all(axis=-1), :3] = (0, 255, 0)
        cv2.imwrite(str(path), mask)
        scene = path.with_name(f"scene{path.stem.removeprefix('mask')}.json")
        scene.write_text(json.dumps(json.loads(scene.read_text()) | {"ball": None}))
        number = path.stem.removeprefix("mask")
        for each in (tmp_path / "data").glob(f"*{number}.*"):
            shutil.copy(each, each.with_name(each.name.replace(number, f"1{number}")))
    assert calibrate("ball", tmp_path / "data", "-o", tmp_path / "unsure.onnx") == 0
    assert "unsure.onnx has no canary, because its networks do not find every class" in capsys.readouterr().err
    assert read_model(tmp_path / "unsure.onnx").canary is None


def test_what_can_not_be_calibrated_is_one_line(data, tmp_path, capsys):
    for arguments, said in (
        ((MODEL, data, "-o", tmp_path / "a.onnx"), "has no peaks: only their confidence"),
        (("bal", data, "-o", tmp_path / "a.onnx"), "unknown network 'bal'; did you mean 'ball'?"),
        ((MODEL, data, "-o", MODEL), "is an input and would be overwritten"),
        (("ball", data, "-o", "/nowhere/a.onnx"), "/nowhere"),
        (("ball", data, "-o", tmp_path / "a.pt"), "a.pt must end in .onnx"),
        (("ball", draw_set(tmp_path / "few", 2), "-o", tmp_path / "a.onnx"), "which needs 10 of each"),
    ):
        assert calibrate(*arguments) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("vm-evaluate: ")
        assert said in line
    assert not (tmp_path / "a.onnx").exists()
