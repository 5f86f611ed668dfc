"""The training of a close look at goal posts and robots: truths from the scene, and the command as a user types it."""

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.vm_train.commands import run, run_module
from tests.vm_train.fields import CLASSES, STANDING, picture, write_pictures
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
GRAYS = {"ball": 200, "goal": 240, "line": 250, "field": 90, "robot": 30, "environment": 140}


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
def field(tmp_path_factory):
    """A folder of the drawn field in grays, with other brightness in each picture."""
    folder = write_pictures(tmp_path_factory.mktemp("field"), 8)
    grays = np.array([GRAYS[name] for name in CLASSES], dtype=np.uint8)[picture().labels]
    for number in range(8):
        noise = np.random.default_rng(number).integers(0, 12, grays.shape, dtype=np.uint8)
        gray = cv2.add(cv2.convertScaleAbs(grays, alpha=1.0 - 0.05 * number), noise)
        cv2.imwrite(str(folder / f"image{number}.jpg"), cv2.merge([gray] * 3))
    return folder


@pytest.mark.long
@pytest.mark.parametrize("name", ["goal", "robot"])
def test_a_trained_look_goes_into_a_model_file_and_runs_there(field, tiny, tmp_path, name):
    given = ["--from", "soccer", "--config", tiny, "--set", f"patches.object_class={name}", "--workers", 1]
    given += ["--set", "patches.max_proposals=24", "--set", "patches.upright_radius=0.5"]
    lines = run("look", field, "-o", tmp_path / "run", *given).stdout.splitlines()
    assert re.fullmatch(rf"training: \d+ patches, \d+ of them show the object {name}", lines[1])
    contract = LookCheckpoint.load(tmp_path / "run" / "look.pt").contract
    assert (contract.object_class, contract.upright_radius) == (name, 0.5)
    run_module("vm_export.cli", *lines[-1].removeprefix("next: vm-export ").split())
    detector = Detector.from_file(tmp_path / "run" / "model.onnx")
    radii = {key: look.contract.upright_radius for key, look in detector.looks.items()}
    assert radii == {"ball": 0.0, "goal": 0.4, "robot": 0.4} | {name: 0.5}  # the others are those of soccer
    lens = read_lens_file(field / "lens0.yaml")
    found = detector.detect(cv2.imread(str(field / "image0.jpg")), lens.orientation, lens.lens)
    assert found.field is not None
    assert all(np.isfinite(each.position).all() for each in (*found.field.posts, *found.field.robots))


def test_classes_that_nobody_can_look_at_are_refused(field, tiny, tmp_path):
    given = ["--from", "soccer", "--config", tiny, "--set", "patches.object_class=line"]
    done = run("look", field, "-o", tmp_path / "run", *given, code=1)
    assert "'line'" in done.stderr
    assert all(name in done.stderr for name in ("ball", "goal", "robot"))
