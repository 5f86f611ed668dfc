"""Proposals of the mesh network in an evaluation: with a close look only, near true balls, and the same in parts."""

import numpy as np
import pytest

from tests.looks import upright
from tests.vm_export.looks import look_checkpoint
from vm_embedded.detection.settings import Settings
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_export.change_model import change_look
from vm_train.data.pictures import find_pictures
from vm_train.evaluation.answers import load_subject
from vm_train.evaluation.evaluation import Evaluation, Rules, evaluate_pictures
from vm_train.evaluation.mask_colors import classes_with_colors, default_colors
from vm_train.evaluation.tables import as_csv, as_json
from vm_train.evaluation.workers import Job, evaluate

from ...drawn_scenes import MODEL
from .test_evaluation import CLASSES, drawn_pictures

RULES = Rules(radius_of="scene")


@pytest.fixture(scope="module")
def files(drawn):
    return find_pictures(drawn)


@pytest.fixture(scope="module")
def looking(tmp_path_factory):
    """A model file with a close look of random weights."""
    path = tmp_path_factory.mktemp("looking") / "looking.onnx"
    change_look(model_path("ball"), path, look_checkpoint(seed=1))
    return path


@pytest.fixture(scope="module")
def ball_classes():
    model = model_path("ball")
    return classes_with_colors(read_model(model).manifest, default_colors(model, None), [])


def test_a_model_without_a_close_look_has_no_proposals(files):
    result = evaluate_pictures(load_subject(MODEL, Settings()), files[:2], CLASSES, RULES)
    assert result.proposals == {}
    assert "proposals" not in as_csv(result, 0.5)
    assert as_json(result, 0.5)["proposals"] == {}


def test_the_peaks_that_the_look_judges_are_the_proposals(files, looking, ball_classes):
    result = evaluate_pictures(load_subject(looking, Settings()), files, ball_classes, RULES)
    scores = result.proposals["ball"]
    assert len(scores.counts) == len(files)
    row = scores.row()
    assert row["truths"] == result.objects["ball"].ranking(0.5).truths
    assert row["recall_0.5"] > 0.8
    assert max(scores.counts) <= read_model(looking).manifest.look.max_proposals


@pytest.mark.parametrize("as_robot", [False, True])
def test_proposals_are_in_the_frame_of_the_found_objects(looking, as_robot):
    subject = load_subject(looking, Settings(), as_robot)
    for picture, scene in drawn_pictures():
        centers = subject.answer(picture).proposals["ball"]
        positions = centers + np.array([0.0, 0.0, picture.lens.orientation.height])
        nearest = np.linalg.norm(positions - scene.objects[0].center, axis=1).min()
        assert nearest < 0.1 * np.linalg.norm(scene.objects[0].center)


@pytest.mark.parametrize("as_robot", [False, True])
def test_only_objects_have_proposals_also_if_the_look_judges_uprights(tmp_path, as_robot):
    path = tmp_path / "looking.onnx"
    judged = ("ball", upright("goal"), upright("robot"))
    change_look(model_path("soccer"), path, look_checkpoint(classes=judged, max_proposals=7))
    subject = load_subject(path, Settings(), as_robot)
    assert list(Evaluation.empty(subject).proposals) == ["ball"]
    for picture, _ in drawn_pictures():
        found = subject.answer(picture).proposals
        assert list(found) == ["ball"]
        assert len(found["ball"]) <= 7


def test_parts_with_proposals_add_up_in_any_number_of_processes(files, looking, ball_classes):
    job = Job(looking, Settings(min_confidence=0.0), False, ball_classes, RULES)
    subject = job.subject()
    alone, shared = (evaluate(job, subject, files, workers, lambda: None) for workers in (1, 2))
    assert as_json(alone, 0.5) == as_json(shared, 0.5)
    assert as_csv(alone, 0.5)["proposals"] == as_csv(shared, 0.5)["proposals"]
    backwards = evaluate(job, subject, files[::-1], 1, lambda: None)
    assert as_json(backwards, 0.5)["proposals"] == as_json(alone, 0.5)["proposals"]
    assert as_json(backwards, 0.5)["calibration"] == as_json(alone, 0.5)["calibration"]
