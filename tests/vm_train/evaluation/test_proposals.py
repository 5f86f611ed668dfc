"""Proposals of the mesh network in an evaluation: with a close look only, near true balls, and the same in parts."""

import numpy as np
import pytest

from tests.vm_export.looks import look_checkpoint
from vm_embedded.detection.settings import Settings
from vm_embedded.network.bundled import model_path
from vm_embedded.network.close_look import CloseLook
from vm_embedded.network.model_file import read_model
from vm_export.change_model import change_looks
from vm_export.grid import Grid
from vm_train.data.pictures import find_pictures
from vm_train.evaluation.answers import ExactSubject, load_subject
from vm_train.evaluation.evaluation import Rules, evaluate_pictures
from vm_train.evaluation.mask_colors import classes_with_colors, default_colors
from vm_train.evaluation.summary import passed_on
from vm_train.evaluation.tables import as_csv, as_json
from vm_train.evaluation.workers import Job, evaluate

from ...drawn_scenes import MODEL
from .test_evaluation import CLASSES, MANIFEST, ByColor, drawn_pictures

RULES = Rules(radius_of="scene")


@pytest.fixture(scope="module")
def files(drawn):
    return find_pictures(drawn)


@pytest.fixture(scope="module")
def looking(tmp_path_factory):
    """A model file with a close look of random weights."""
    path = tmp_path_factory.mktemp("looking") / "looking.onnx"
    change_looks(MODEL, path, [look_checkpoint(seed=1, above=0.3)])
    return path


def test_a_model_without_a_close_look_has_no_proposals(files):
    result = evaluate_pictures(load_subject(MODEL, Settings()), files[:2], CLASSES, RULES)
    assert result.proposals == {}
    assert "proposals" not in as_csv(result, 0.5)
    assert as_json(result, 0.5)["proposals"] == {}


def test_a_network_that_sees_colors_proposes_drawn_balls(files, looking):
    subject = ExactSubject(MANIFEST, Grid(), "", Settings(), ByColor(), CloseLook.of(read_model(looking)))
    result = evaluate_pictures(subject, files, CLASSES, RULES)
    scores = result.proposals["ball"]
    assert len(scores.counts) == len(files)
    assert scores.recall().truths == result.objects["ball"].ranking(0.5).truths
    assert min(scores.recall().recalls) > 0.8
    few = ExactSubject(MANIFEST, Grid(), "", Settings(max_proposals=1), ByColor(), subject.look)
    assert evaluate_pictures(few, files, CLASSES, RULES).proposals["ball"].largest_count == 1


def test_what_a_glance_passes_on_is_fewer_places_and_nearer_to_the_balls(files):
    model = model_path("ball-small")
    subject = load_subject(model, Settings())
    classes = classes_with_colors(subject.manifest, default_colors(model, None), [])
    result = evaluate_pictures(subject, files, classes, RULES)
    proposed, passed = result.proposals["ball"], result.passed["ball"]
    assert passed.recall().truths == proposed.recall().truths
    assert 0 < passed.mean_count < proposed.mean_count
    assert passed.recall().recalls[0] >= proposed.recall().recalls[0]
    said = passed_on(as_json(result, 0.5)["passed"]["ball"])
    assert said.startswith(f"The glance passes on {passed.mean_count:.1f} per picture")


@pytest.mark.parametrize("as_robot", [False, True])
def test_proposals_are_in_the_frame_of_the_found_objects(looking, as_robot):
    subject = load_subject(looking, Settings(), as_robot)
    for picture, scene in drawn_pictures():
        centers = subject.answer(picture).proposals["ball"]
        positions = centers + np.array([0.0, 0.0, picture.lens.orientation.height])
        nearest = np.linalg.norm(positions - scene.objects[0].center, axis=1).min()
        assert nearest < 0.1 * np.linalg.norm(scene.objects[0].center)


def test_parts_with_proposals_add_up_in_any_number_of_processes(files, looking):
    job = Job(looking, Settings(min_confidence=0.0), False, CLASSES, RULES)
    subject = job.subject()
    alone, shared = (evaluate(job, subject, files, workers, lambda: None) for workers in (1, 2))
    assert as_json(alone, 0.5) == as_json(shared, 0.5)
    assert as_csv(alone, 0.5)["proposals"] == as_csv(shared, 0.5)["proposals"]
    backwards = evaluate(job, subject, files[::-1], 1, lambda: None)
    assert as_json(backwards, 0.5)["proposals"] == as_json(alone, 0.5)["proposals"]
    assert as_json(backwards, 0.5)["calibration"] == as_json(alone, 0.5)["calibration"]
