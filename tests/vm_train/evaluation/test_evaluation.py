"""Evaluations: of both kinds of models, of parts and of all, and of networks that know the truth."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError, ModelError
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.network.model_file import read_model
from vm_export.checkpoint import Checkpoint
from vm_export.export import export
from vm_export.grid import Grid
from vm_train.data.pictures import Picture, find_pictures, read_picture
from vm_train.evaluation.answers import ExactSubject, load_subject
from vm_train.evaluation.evaluation import Evaluation, Rules, evaluate_pictures
from vm_train.evaluation.mask_colors import classes_with_colors, default_colors
from vm_train.evaluation.tables import as_csv, as_json
from vm_train.evaluation.workers import Job, evaluate
from vm_train.truth.objects import SceneObject, SceneTruth, read_scene, true_objects

from ...drawn_scenes import CHECKPOINT, FOLDER, IMAGES, MODEL, TRUTH
from ..drawn import RADIUS, draw_set

MANIFEST = read_model(MODEL).manifest


USUAL = default_colors(Path("model.onnx"), None)


CLASSES = classes_with_colors(MANIFEST, USUAL, [])


SETTINGS = Settings()


@pytest.fixture(scope="module")
def files(drawn):
    return find_pictures(drawn)


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """The drawn frames' network as a checkpoint and as a model file."""
    paths = {"pt": CHECKPOINT, "onnx": tmp_path_factory.mktemp("models") / "model.onnx"}
    export(Checkpoint.load(CHECKPOINT), paths["onnx"])
    return {name: load_subject(path, SETTINGS) for name, path in paths.items()}


def drawn_pictures():
    """The drawn frames' frames, which have no masks, with labels of nothing but field and with their balls."""
    truth = json.loads(TRUTH.read_text())
    for path in IMAGES:
        image = cv2.imread(str(path))
        lens = read_lens_file(FOLDER / path.name.replace("image", "lens").replace(".jpg", ".yaml"))
        ball = truth[path.name]
        scene = SceneTruth(ball["radius"], (SceneObject(np.array(ball["position"]), ball["radius"], 1.0),))
        yield Picture(image, np.full(image.shape[:2], 2, dtype=np.int8), lens), scene


def test_checkpoints_and_model_files_answer_alike_in_every_layout(models, files):
    pictures = [read_picture(each, CLASSES) for each in files[:3]] + [picture for picture, _ in drawn_pictures()][:2]
    for picture in pictures:
        answers = {name: subject.answer(picture) for name, subject in models.items()}
        for each in answers.values():
            assert each.probabilities == pytest.approx(answers["pt"].probabilities, abs=1e-4)
            assert (each.pixels == answers["pt"].pixels).all()
            assert (each.distances == answers["pt"].distances).all()
            assert len(each.found) == len(answers["pt"].found)
            for one, other in zip(each.found, answers["pt"].found, strict=True):
                assert one.position == pytest.approx(other.position, abs=1e-3)


def test_scores_of_checkpoints_and_model_files_agree(models, files):
    rules = Rules(radius_of="scene")
    scores = [as_json(evaluate_pictures(subject, files, CLASSES, rules), 0.5) for subject in models.values()]
    for each in scores[1:]:
        assert each["pictures"] == 10
        assert each["objects"] == scores[0]["objects"]
        for name, bins in each["points"].items():
            expected = scores[0]["points"][name]["all"]
            assert bins["all"]["average_precision"] == pytest.approx(expected["average_precision"], abs=1e-3)


def test_the_drawn_balls_are_found_where_they_are(models):
    result = Evaluation.empty(models["onnx"])
    files = find_pictures(FOLDER)
    for each, (picture, scene) in zip(files, drawn_pictures(), strict=True):
        result.count(each, picture, scene, models["onnx"].answer(picture), MANIFEST)
    ranking = result.objects["ball"].ranking(0.5)
    assert ranking.at().hits == 6
    assert ranking.errors().distance_median < 0.06
    assert ranking.errors().relative_p90 < 0.04


def test_a_robot_finds_the_same_balls_with_its_shared_meshes(models):
    robot = load_subject(MODEL, SETTINGS, as_robot=True)
    for picture, scene in drawn_pictures():
        answer = robot.answer(picture)
        nearest = min(np.linalg.norm(each.position - scene.objects[0].center) for each in answer.found)
        assert nearest < 0.05 * np.linalg.norm(scene.objects[0].center)
        exact = models["pt"].answer(picture)
        assert len(answer.distances) == pytest.approx(len(exact.distances), rel=0.35)
        assert np.isfinite(answer.distances).all()


class ByColor:
    """A network that knows how pictures are drawn: orange balls, green fields, white lines."""

    def run(self, layout, colors, on_screen, points):
        red, green, blue = colors
        answers = np.select([red > 1.4 * blue, green > 1.4 * red, red + green + blue > 1.6], [0, 2, 1], 3)
        return np.eye(4, dtype=np.float32)[answers[points]]


class Always:
    """A network that gives every point the same answer."""

    def __init__(self, answer):
        self.answer = np.float32(answer)

    def run(self, layout, colors, on_screen, points):
        return np.tile(self.answer, (len(points), 1))


KNOWING = ExactSubject(MANIFEST, Grid(), "", SETTINGS, ByColor())


def test_a_network_that_sees_colors_is_nearly_perfect_on_drawn_balls(files):
    result = evaluate_pictures(KNOWING, files, CLASSES, Rules(radius_of="scene"))
    assert result.points.ranking("ball").at(0.5).recall > 0.8
    ranking = result.objects["ball"].ranking(0.5)
    assert ranking.truths >= 6
    assert ranking.at().recall >= 0.7
    assert ranking.errors().distance_median < 0.05


def test_a_hexagonal_network_has_scores_of_points_only(files):
    checkpoint = Checkpoint.load(CHECKPOINT)
    network = load_subject(CHECKPOINT, SETTINGS).network
    subject = ExactSubject(checkpoint.manifest, Grid("hexagonal"), "", SETTINGS, network)
    result = evaluate_pictures(subject, files[:2], CLASSES, Rules())
    assert result.objects == {}
    assert result.points.confusion().sum() > 100
    assert "objects" not in as_csv(result, 0.5)


def test_parts_add_up_in_any_number_of_processes(files):
    job = Job(MODEL, SETTINGS, False, CLASSES, Rules())
    subject, ticks = job.subject(), []
    alone = evaluate(job, subject, files, 1, lambda: ticks.append(1))
    shared = evaluate(job, subject, files, 2, lambda: ticks.append(1))
    assert len(ticks) == 20
    assert as_json(alone, 0.5) == as_json(shared, 0.5)
    assert as_csv(alone, 0.5) == as_csv(shared, 0.5)
    assert [each.files.number for each in alone.poses] == [f"{number:04d}" for number in range(10)]
    for one, other in zip(alone.worst.missed, shared.worst.missed, strict=True):
        assert (one.image, one.rank) == (other.image, other.rank)


def test_the_largest_missed_and_the_most_confident_false_come_first(files):
    blind = replace(KNOWING, network=Always([0, 0, 1, 0]))
    result = evaluate_pictures(blind, files, CLASSES, Rules())
    ranks = [each.rank for each in result.worst.missed]
    assert len(ranks) == result.objects["ball"].ranking(0.5).truths
    assert ranks == sorted(ranks, reverse=True)
    assert result.worst.false == ()
    assert all(len(each.true) == 1 for each in result.worst.missed)


def test_pictures_that_can_t_be_used_are_named(tmp_path):
    folder = draw_set(tmp_path / "set", 6)
    (folder / "mask0001.png").unlink()
    (folder / "image0002.jpg").write_bytes((folder / "image0002.jpg").read_bytes()[:500])
    (folder / "lens0003.yaml").write_text("projection: RECTILINEAR\n")
    (folder / "scene0004.json").write_text("{}")
    result = evaluate_pictures(KNOWING, find_pictures(folder), CLASSES, Rules())
    assert [path[-8:-4] for path in result.faults] == ["0001", "0002", "0003", "0004"]
    assert len(result.poses) == 2
    with pytest.raises(InputError, match="mask0001"):
        evaluate_pictures(KNOWING, find_pictures(folder), CLASSES, Rules(strict=True))


def test_a_camera_below_the_ball_is_named(tmp_path):
    folder = draw_set(tmp_path / "set", 1)
    lens = (folder / "lens0000.yaml").read_text().splitlines()
    row = lens[-2].rsplit(",", 1)[0] + ", 0.05]"
    (folder / "lens0000.yaml").write_text("\n".join([*lens[:-2], row, lens[-1]]) + "\n")
    result = evaluate_pictures(KNOWING, find_pictures(folder), CLASSES, Rules())
    assert "diameter" in next(iter(result.faults.values()))


def test_colors_of_no_class_end_it(tmp_path):
    folder = draw_set(tmp_path / "set", 2)
    mask = cv2.imread(str(folder / "mask0001.png"), cv2.IMREAD_UNCHANGED)
    mask[:5, :5] = (255, 0, 0, 255)
    cv2.imwrite(str(folder / "mask0001.png"), mask)
    with pytest.raises(InputError, match=r"/mask0001\.png: 25 pixels .*\[0, 0, 255\]"):
        evaluate_pictures(KNOWING, find_pictures(folder), CLASSES, Rules())
    known = classes_with_colors(MANIFEST, USUAL, [("environment", (0, 0, 255))])
    assert len(evaluate_pictures(KNOWING, find_pictures(folder), known, Rules()).poses) == 2


def test_answers_that_are_no_probabilities_end_it(files):
    broken = replace(KNOWING, network=Always(np.full(4, np.nan)))
    with pytest.raises(ModelError, match="0 to 1"):
        evaluate_pictures(broken, files, CLASSES, Rules())


def test_the_radius_of_a_scene_makes_mesh_and_fit(files, tmp_path):
    subject = load_subject(MODEL, SETTINGS)
    picture = read_picture(files[0], CLASSES)
    few, many = len(subject.answer(picture).distances), len(subject.answer(picture, RADIUS).distances)
    assert many > 1.4 * few  # a smaller ball needs a finer mesh: (0.095 / 0.07)^2
    folder = draw_set(tmp_path / "set", 2)
    (folder / "scene0000.json").unlink()
    result = evaluate_pictures(subject, find_pictures(folder), CLASSES, Rules(radius_of="scene"))
    assert "scene0000.json" in next(iter(result.faults.values()))
    assert result.radii == [RADIUS]


def test_objects_of_masks_have_the_radius_that_was_looked_for(files):
    """Without its scene, a ball of 0.07 m is placed right only with its own radius."""
    errors = {0.07: [], 0.095: []}
    for each in files:
        picture, scene = read_picture(each, CLASSES), read_scene(each.image.with_name(f"scene{each.number}.json"))
        for radius, found in errors.items():
            answer = load_subject(MODEL, Settings(object_radius=radius)).answer(picture)
            seen = true_objects(picture, None, answer.manifest)["ball"]
            if len(seen) == len(scene.objects) == 1 and scene.objects[0].visible > 0.95:
                found.append(np.linalg.norm(seen[0].position - scene.objects[0].center))
    assert len(errors[0.07]) > 2
    assert np.median(errors[0.07]) < 0.5 * np.median(errors[0.095])
