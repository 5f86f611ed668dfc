"""The training of a close look at balls, goal posts and robots: truths from the scene, and the command as a user types
it."""

import json
import re
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.vm_train.commands import run, run_module
from tests.vm_train.fields import CLASSES, STANDING, picture
from vm_embedded import Detector, read_lens_file
from vm_embedded.detection.looking import around_bases
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.network.bundled import model_path
from vm_export.look_checkpoint import LookCheckpoint
from vm_train.evaluation.answers import load_subject
from vm_train.look.labels import NOTHING, OBJECT, UNLABELED, label_places, true_bases
from vm_train.look.places import PatchPlaces
from vm_train.truth.field import FieldScene, Standing

RADIUS = 0.3
SCENE = FieldScene(
    tuple(Standing(each["kind"], each["base"], each["width"], each["height"]) for each in STANDING), False, None
)


@pytest.fixture(scope="module")
def view():
    """The view of the drawn field, with circles around bases."""
    subject = load_subject(model_path("soccer"), Settings())
    return around_bases(subject.observe(picture()), RADIUS)


@pytest.fixture(scope="module")
def posts(view):
    return true_bases(picture(), SCENE, CLASSES, view, "post")


def test_truths_are_bases_on_the_plane_with_their_visibility_and_width(view, posts):
    positions = posts.centers @ view.heading.T
    assert positions[:, :2] == pytest.approx(np.array([each["base"] for each in STANDING[:3]]))
    assert positions[:, 2] == pytest.approx(-view.height)
    assert posts.visible.tolist() == [1.0, 1.0, 0.0]
    assert posts.radii.tolist() == [RADIUS] * 3
    assert np.exp(posts.sizes) * 2.0 * RADIUS == pytest.approx(0.1)
    robots = true_bases(picture(), SCENE, CLASSES, view, "robot")
    assert robots.visible.tolist() == [1.0, 0.0]
    assert np.exp(robots.sizes) * 2.0 * RADIUS == pytest.approx(0.4)


def test_places_beside_a_base_learn_its_shift_and_its_width(view, posts):
    beside = posts.centers[1] + (0.0, 0.2, 0.0)
    found = label_places(PatchPlaces.of(beside[None]).tangents(view), posts)
    assert found.labels.tolist() == [OBJECT]
    assert found.of.tolist() == [1]
    assert found.targets[0, 0] == pytest.approx(0.2 / RADIUS, abs=0.1)  # to the right, back to the base
    assert found.targets[0, 2] == pytest.approx(posts.sizes[1], abs=0.02)


@pytest.mark.parametrize("factor", [0.8, 1.0, 1.25])
def test_in_a_patch_that_is_cut_larger_an_upright_is_narrower(view, posts, factor):
    places = PatchPlaces(posts.centers[1:2], np.array([factor]))
    target = label_places(places.tangents(view), posts).targets[0, 2]
    assert target == pytest.approx(posts.sizes[1] - np.log(factor), abs=1e-4)


def test_places_far_from_bases_show_nothing_and_those_at_hidden_ones_are_left_out(view, posts):
    far = label_places(PatchPlaces.of(posts.centers[1:2] + np.array([0.0, 0.6, 0.0])).tangents(view), posts)
    assert far.labels.tolist() == [NOTHING]
    assert far.targets.tolist() == [[0.0, 0.0, 0.0]]
    robots = true_bases(picture(), SCENE, CLASSES, view, "robot")
    hidden = label_places(PatchPlaces.of(robots.centers[1:]).tangents(view), robots)
    assert hidden.labels.tolist() == [UNLABELED]


def test_a_picture_with_nothing_on_the_plane_has_no_truths(view):
    assert len(true_bases(picture(), replace(SCENE, standing=()), CLASSES, view, "post")) == 0


@pytest.mark.parametrize("scene", [None, replace(SCENE, standing=None)])
def test_a_scene_that_does_not_tell_what_stands_there_is_refused(view, scene):
    with pytest.raises(InputError, match="does not tell what stands on the plane"):
        true_bases(picture(), scene, CLASSES, view, "post")


@pytest.fixture(scope="module")
def together(field, tiny, tmp_path_factory):
    """The folder of a training for balls and uprights, and what it printed."""
    folder = tmp_path_factory.mktemp("together") / "run"
    given = ["--from", "soccer", "--config", tiny, "--workers", 1]
    given += ["--set", "patches.max_proposals=24", "--set", "patches.upright_radius=0.5"]
    return folder, run("look", field, "-o", folder, *given).stdout.splitlines()


@pytest.mark.long
def test_a_training_tells_each_class(together):
    folder, lines = together
    found = r"  \d+ proposals, \d+ of them right: \d+ of \d+ visible objects \(\d+ %\)"
    for name, first, second in zip(("ball", "goal", "robot"), lines[1:7:2], lines[2:7:2], strict=True):
        assert re.fullmatch(rf"{name}: \d+ patches for training, \d+ of them with the object; for validation", first)
        assert re.fullmatch(found, second)
    score = r"[\d.]+ / [\d.]+ / [\d.]+"
    errors = f"center error {score} radii, size error {score} %"
    assert re.match(rf"epoch 4 of 4: validation AP of ball / goal / robot {score}, {errors}; ", lines[11])
    for name, line in zip(("ball", "goal", "robot"), lines[12:15], strict=True):
        assert line.startswith(f"{folder / 'look.pt'}, {name}: in ")


@pytest.mark.long
def test_its_network_has_a_calibration_and_examples_of_each_class(field, together):
    folder, _ = together
    made = LookCheckpoint.load(folder / "look.pt")
    contract = made.contract
    judged = [(each.name, each.upright_radius, each.mesh_weight) for each in contract.classes]
    assert judged == [("ball", 0.0, 0.0), ("goal", 0.5, 0.0), ("robot", 0.5, 0.0)]
    assert made.examples.shape[0] > 4
    results = json.loads((folder / "result.json").read_text())
    fitted = [(results[name]["calibration"]["scale"], results[name]["calibration"]["offset"]) for name in results]
    assert list(results) == list(contract.names)
    assert made.network.calibration.numpy() == pytest.approx(np.array(fitted), rel=1e-5)
    assert {each.calibrated_on for each in contract.classes} == {f"1 validation pictures of {field.name}"}
    assert re.fullmatch(r"[\d.]+, [\d.]+, [\d.]+", contract.provenance["validation_average_precision"])


@pytest.mark.long
def test_a_trained_look_goes_into_a_model_file_and_runs_there(field, together):
    folder, lines = together
    run_module("vm_export.cli", *lines[-1].removeprefix("next: vm-export ").split())
    detector = Detector.from_file(folder / "model.onnx")
    radii = {each.name: each.upright_radius for each in detector.look.contract.classes}
    assert radii == {"ball": 0.0, "goal": 0.5, "robot": 0.5}
    lens = read_lens_file(field / "lens0.yaml")
    found = detector.detect(cv2.imread(str(field / "image0.jpg")), lens.orientation, lens.lens)
    assert found.field is not None
    assert all(np.isfinite(each.position).all() for each in (*found.objects, *found.field.posts, *found.field.robots))


@pytest.mark.parametrize(("name", "changes"), [("ball", {"ball": None}), ("robot", {"standing": STANDING[:3]})])
def test_a_class_that_no_picture_shows_is_named(name, changes, field, tiny, tmp_path):
    folder = shutil.copytree(field, tmp_path / "field")
    for path in folder.glob("scene*.json"):
        path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    given = ["--from", "soccer", "--config", tiny, "--workers", 1]
    done = run("look", folder, "-o", tmp_path / "run", *given, code=1)
    assert re.search(rf"none of the \d+ patches for training show the object {name}: ", done.stderr)
