"""The true field features of a painted field."""

import math

import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_synth.render.ground import paint_ground
from vm_train.scores.field_scores import FieldScores
from vm_train.truth.field import field_truth, read_field
from vm_train.truth.field_model import FieldModel
from vm_train.truth.ground_view import GroundView

from ..fields import CAMERA, CLASSES, FIELD, features, picture, pixels_of, scene_table, write_scene


@pytest.fixture
def scene(tmp_path):
    return read_field(write_scene(tmp_path / "scene1.json"))


@pytest.fixture
def truth(scene):
    return field_truth(picture(), scene, CLASSES)


def perfect(truth, model, scale=1.0):
    """The truth as reported features, with all places scaled."""
    (center, radius), *_ = model.lines().circles
    places = {kind: [each.position * scale for each in found if each.visible] for kind, found in truth.uprights.items()}
    return features(
        posts=places["post"],
        robots=places["robot"],
        lines=model.lines().segments * scale,
        circle=(center * scale, radius * scale),
        border=model.carpet() * scale,
    )


def test_the_middle_lines_are_in_the_middle_of_what_vm_synth_paints(scene):
    lines = scene.field.lines()
    x, y = np.meshgrid(np.arange(-3.0, 8.5, 0.02), np.arange(-4.0, 5.5, 0.02))
    ground = np.stack([x, y], axis=-1)
    _, painted, carpet = paint_ground(FIELD, ground, np.ones_like(x), 0.001)
    local = (ground - np.array(FIELD.middle)) @ FIELD.rotation
    marks = np.hypot(local[..., 0], local[..., 1]) < 0.12
    marks |= np.hypot(np.abs(local[..., 0]) - FIELD.length / 3.0, local[..., 1]) < 0.12
    distance = lines.distances(ground.reshape(-1, 2)).reshape(x.shape)
    assert distance[(painted > 0.5) & ~marks].max() < FIELD.line_width / 2.0 * math.sqrt(2.0) + 0.02
    assert painted[distance < FIELD.line_width / 2.0 - 0.02].min() > 0.5
    edge = np.abs(local) - (FIELD.length / 2.0 + FIELD.border, FIELD.width / 2.0 + FIELD.border)
    assert ((carpet > 0.5) == (edge.max(axis=-1) < 0.0)).mean() > 0.999
    assert scene.field.carpet()[0] == pytest.approx(np.array([5.1, 3.6]) @ FIELD.rotation.T + FIELD.middle)


def test_a_view_projects_as_the_lens_does():
    view = GroundView.of(picture())
    places = np.array([(3.0, 0.5), (5.0, 3.0)])
    assert view.pixels(places, 0.4) == pytest.approx(pixels_of(np.column_stack([places, [0.4, 0.4]])))
    behind = np.array([(-3.0, 0.0)])
    assert np.isnan(view.pixels(behind)).all()
    assert view.shows(np.concatenate([places, behind])).tolist() == [True, True, False]


def test_what_is_hidden_or_outside_of_the_picture_is_not_visible(truth):
    visible = {kind: [each.visible for each in found] for kind, found in truth.uprights.items()}
    assert visible == {"post": [True, True, False], "robot": [True, False], "person": [False]}


def test_a_post_without_its_color_in_the_mask_is_not_visible(scene):
    shown = picture()
    shown.labels[shown.labels == CLASSES.index("goal")] = CLASSES.index("environment")
    assert not any(each.visible for each in field_truth(shown, scene, CLASSES).uprights["post"])


def test_visible_lines_are_near_the_camera_and_not_hidden(truth, scene):
    lines = scene.field.lines()
    assert lines.distances(truth.field.visible).max() < 1e-9
    assert 500 < len(truth.field.visible) < len(lines.samples())
    x, y = np.rint(pixels_of(np.column_stack([truth.field.visible, np.zeros(len(truth.field.visible))]))).astype(int).T
    labels = picture().labels
    assert (labels[y, x] == CLASSES.index("line")).mean() > 0.9
    unpainted = field_truth(picture(lines=False), scene, CLASSES)
    assert len(unpainted.field.visible) == 0
    assert unpainted.field.lines.samples().tolist() == lines.samples().tolist()


def test_the_border_is_where_the_mask_ends(truth):
    labels, field = picture(standing=()).labels, truth.field
    ground = (labels == CLASSES.index("field")) | (labels == CLASSES.index("line"))
    assert len(field.directions) > 15
    assert np.all(field.distances <= 12.0)
    unit = np.column_stack([np.cos(field.directions), np.sin(field.directions), np.zeros(len(field.directions))])
    step = 2.0 * field.distances**2 / (CAMERA.height * 330.0) + 0.01  # about two pixels
    for far, expected in ((-step, True), (step, False)):
        x, y = np.rint(pixels_of(unit * (field.distances + far)[:, None])).astype(int).T
        inside = (x >= 0) & (x < labels.shape[1]) & (y >= 0) & (y < labels.shape[0])
        assert inside.sum() > 15
        assert (ground[y[inside], x[inside]] == expected).all()


def test_the_truth_fed_back_is_perfect(truth, scene):
    scores = FieldScores()
    scores.add(truth, perfect(truth, scene.field))
    found = scores.as_dict()
    for name, count in (("posts", 2), ("robots", 1)):
        row = found[name]["all"]
        assert (row["visible"], row["found"], row["false"], row["error_median"]) == (count, count, 0, 0.0)
    assert (found["lines"]["all"]["recall"], found["lines"]["all"]["wrong_share"]) == (1.0, 0.0)
    border = found["border"]["all"]
    assert (border["reported_share"], border["error_median"]) == (1.0, pytest.approx(0.0))


def test_the_truth_fed_back_6_percent_too_far_is_not_found(truth, scene):
    scores = FieldScores()
    scores.add(truth, perfect(truth, scene.field, 1.06))
    found = scores.as_dict()
    assert (found["posts"]["all"]["found"], found["posts"]["all"]["false"]) == (0, 0)
    assert found["robots"]["all"]["found"] == 1
    assert found["lines"]["all"]["recall"] < 0.6
    assert found["border"]["all"]["error_median"] == pytest.approx(0.06)


def test_files_without_standing_or_field_have_no_such_truth(tmp_path):
    assert read_field(tmp_path / "scene2.json") is None
    scene = read_field(write_scene(tmp_path / "scene1.json", {"ball": None}))
    assert (scene.standing, scene.has_field, scene.field) == (None, False, None)
    for each in (None, scene):
        truth = field_truth(picture(), each, CLASSES)
        assert (truth.uprights, truth.field) == (None, None)


def test_a_scene_without_a_field_has_no_lines_and_no_border(tmp_path):
    scene = read_field(write_scene(tmp_path / "scene1.json", {"field": None, "standing": []}))
    truth = field_truth(picture(), scene, CLASSES)
    assert truth.uprights == {"post": [], "robot": [], "person": []}
    scores = FieldScores()
    scores.add(truth, features(lines=[((1.0, 0.0), (2.0, 0.0))], border=[(1.0, -1.0), (1.0, 1.0)]))
    assert scores.lines.row()["wrong_share"] == 1.0
    assert scores.border.unasked == 1


def test_endless_grass_has_no_border(tmp_path):
    table = scene_table()
    table["field"]["border"] = None
    truth = field_truth(picture(), read_field(write_scene(tmp_path / "scene1.json", table)), CLASSES)
    assert len(truth.field.directions) == 0
    assert len(truth.field.visible) > 500


@pytest.mark.parametrize(
    "change",
    [
        {"standing": 3},
        {"standing": {"kind": "post"}},
        {"standing": [3]},
        {"standing": [{"kind": "post", "base": [1.0, 2.0], "width": 0.1}]},
        {"standing": [{"kind": "post", "base": [1.0], "width": 0.1, "height": 1.0}]},
        {"standing": [{"kind": "cow", "base": [1.0, 2.0], "width": 0.1, "height": 1.0}]},
        {"standing": [{"kind": "post", "base": [1.0, math.nan], "width": 0.1, "height": 1.0}]},
        {"standing": [{"kind": "post", "base": [1.0, 2.0], "width": 0.0, "height": 1.0}]},
        {"field": 3},
        {"field": {"length": 9.0}},
        {"field": scene_table()["field"] | {"length": -9.0}},
        {"field": scene_table()["field"] | {"border": -0.1}},
        {"field": scene_table()["field"] | {"border": math.nan}},
        {"field": scene_table()["field"] | {"middle": [1.0]}},
        {"field": scene_table()["field"] | {"heading": math.inf}},
    ],
)
def test_entries_that_make_no_sense_are_named_in_one_line(tmp_path, change):
    path = write_scene(tmp_path / "scene7.json", scene_table() | change)
    with pytest.raises(InputError, match=r"^scene7\.json: [^\n]*$"):
        read_field(path)


@pytest.mark.parametrize("text", ["", "[1]", "3", "{", "[" * 100000])
def test_damaged_scenes_are_named(tmp_path, text):
    path = tmp_path / "scene7.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"^scene7\.json: [^\n]*$"):
        read_field(path)


def test_a_field_turns_with_its_heading():
    turned = FieldModel(4.0, 2.0, 0.5, (1.0, 1.0), math.pi / 2.0)
    assert turned.placed(np.array([1.0, 0.0])) == pytest.approx(np.array([1.0, 2.0]))
    assert turned.carpet()[0] == pytest.approx(np.array([-0.5, 3.5]))
