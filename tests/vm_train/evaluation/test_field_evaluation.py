"""Field features in an evaluation: which networks have their scores, and where the scores are written."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest

from vm_embedded.network.manifest import ObjectClass
from vm_embedded.network.model_file import read_model
from vm_export.grid import Grid
from vm_train.data.classes import Classes
from vm_train.data.pictures import find_pictures
from vm_train.evaluation.answers import PictureAnswer
from vm_train.evaluation.evaluation import Evaluation, Rules, evaluate_pictures
from vm_train.evaluation.report import page
from vm_train.evaluation.summary import field_tables, lines
from vm_train.evaluation.tables import as_csv, as_json

from ...drawn_scenes import MODEL
from ..fields import CLASSES, COLORS, features, write_pictures

MANIFEST = replace(
    read_model(MODEL).manifest,
    classes=tuple(ObjectClass(name, "object" if name == "ball" else "area") for name in CLASSES),
)
NAMED = Classes({name: (COLORS[name],) for name in CLASSES})
ABOUT = {
    "model": {"file": "model.onnx"},
    "data": {"folders": ["data"]},
    "rules": {},
    "settings": {},
    "notes": [],
    "made_by": "vm-evaluate",
}


class Reporting:
    """A network that reports the same features for every picture."""

    sha256 = ""

    def __init__(self, reported, manifest=MANIFEST, grid="visual"):
        self.reported, self.manifest, self.grid, self.look = reported, manifest, Grid(grid), None

    def answer(self, picture, radius=None):
        none = np.zeros((0, len(self.manifest.classes)), dtype=np.float32)
        return PictureAnswer(np.zeros((0, 2)), np.zeros(0), none, (), {}, self.manifest, self.reported)


REPORTING = Reporting(features(posts=[(5.0, 2.0)], robots=[(2.5, 1.6), (4.0, 0.9)]))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return find_pictures(write_pictures(tmp_path_factory.mktemp("field"), 3))


@pytest.fixture(scope="module")
def result(files):
    return evaluate_pictures(REPORTING, files, NAMED, Rules())


def test_field_features_have_scores(result):
    found = as_json(result, 0.5)["field"]
    assert list(found) == ["posts", "robots", "lines", "border"]
    posts, robots = found["posts"]["near"], found["robots"]["near"]
    assert (posts["visible"], posts["found"], posts["false_per_picture"]) == (6, 3, 0.0)
    assert (robots["visible"], robots["found"], robots["people"], robots["false"]) == (3, 3, 3, 0)
    assert found["lines"]["near"]["recall"] == 0.0
    assert found["border"]["all"]["reported_share"] == 0.0


def test_confidences_of_posts_and_robots_reach_their_scores(result):
    posts = result.features.posts.ranking()
    assert (posts.confidence.tolist(), posts.right.tolist()) == (
        [each.confidence for each in REPORTING.reported.posts] * 3,
        [True] * 3,
    )
    robots = result.features.robots.ranking()  # of the two, one is a person
    assert robots.confidence.tolist() == [REPORTING.reported.robots[0].confidence] * 3


def test_parts_add_up(files, result):
    parts = [evaluate_pictures(REPORTING, each, NAMED, Rules()) for each in (files[:1], files[1:])]
    total = Evaluation.empty(REPORTING) + parts[0] + parts[1]
    assert as_json(total, 0.5)["field"] == as_json(result, 0.5)["field"]


def test_the_table_holds_the_same_numbers(result):
    rows = list(csv.DictReader(io.StringIO(as_csv(result, 0.5)["field"])))
    scores = as_json(result, 0.5)["field"]
    assert {each["feature"] for each in rows} == set(scores)
    for each in rows:
        for key, value in scores[each["feature"]][each["distance"]].items():
            assert each[key] == ("" if value is None else str(value))


def test_summary_and_report_have_their_tables(result):
    scores = {"about": ABOUT, **as_json(result, 0.5)}
    printed, shown = lines(scores), page(scores, {}, {})
    for name in ("posts", "robots", "lines", "border"):
        assert f"\n{name} of the field\n" in printed
        assert f"<h2>{name.capitalize()} of the field</h2>" in shown
    heading, rows = field_tables(scores["field"])["posts of the field"]
    near = dict(zip(heading, next(row for row in rows if row[0] == "0-8"), strict=True))
    assert near["within 5 %"] == "50.0 %"
    assert near["error median"] == "0.0 %"


@pytest.mark.parametrize(
    "network",
    [
        Reporting(REPORTING.reported, replace(MANIFEST, classes=MANIFEST.classes[:4] + MANIFEST.classes[5:])),
        Reporting(REPORTING.reported, grid="hexagonal"),
    ],
    ids=["without the class robot", "hexagonal"],
)
def test_other_networks_have_no_scores_of_field_features(network):
    empty = Evaluation.empty(network)
    assert (empty + empty).features is None
    assert as_json(empty, 0.5)["field"] == {}
    assert "field" not in as_csv(empty, 0.5)
    assert field_tables(as_json(empty, 0.5)["field"]) == {}


def test_a_detector_without_features_has_no_tables(files):
    found = as_json(evaluate_pictures(Reporting(None), files[:1], NAMED, Rules()), 0.5)["field"]
    assert field_tables(found) == {}


def test_a_damaged_scene_is_named(tmp_path):
    files = find_pictures(write_pictures(tmp_path, 1))
    path = tmp_path / "scene0.json"
    path.write_text(path.read_text().replace('"robot"', '"cow"'))
    (fault,) = evaluate_pictures(REPORTING, files, NAMED, Rules()).faults.values()
    assert fault.startswith("scene0.json: is not a scene file of vm-synth")
    assert "cow" in fault
