"""The networks in the package load, have a model card, and find balls."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.messages import read_message
from vm_embedded.detection.detector import Detector
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.live.configuration import read_configuration
from vm_embedded.network import bundled
from vm_embedded.network.bundled import DEFAULT, SHIPPED, model_path, shipped_name
from vm_embedded.network.model_file import read_model

TOP = Path(__file__).parents[1]
DEMO = TOP / "tests" / "fixtures" / "demo"


def detect(*arguments):
    command = [str(Path(sys.executable).with_name("vm-detect")), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [read_message(line) for line in done.stdout.splitlines()]


@pytest.mark.parametrize("name", SHIPPED)
def test_a_network_runs_and_matches_its_card(name):
    path = model_path(name)
    detector = Detector.from_file(name)  # raises if the self-test fails
    assert detector.manifest.any_radius
    known = ["ball", "goal", "line", "field", "environment", "robot"] if name == "soccer" else ["ball", "other"]
    assert [each.name for each in detector.manifest.classes] == known
    looks = ["ball", "goal", "robot"] if name == "soccer" else ["ball"]
    assert list(detector.looks) == looks
    assert path.stat().st_size < {"ball": 300_000, "soccer": 600_000}[name]
    card = path.with_suffix(".md").read_text()
    assert read_model(path).sha256 in card
    assert re.search(r"AP50", card)
    for recipe in (f"export/networks/{part}.toml" for part in (name, *(f"{each}-look" for each in looks))):
        assert recipe in card
        assert (TOP / recipe).exists()


@pytest.mark.long
def test_without_a_name_the_default_is_used():
    image = min(DEMO.glob("image*.jpg"))
    given = [detect("--camera", image), detect("--camera", image, "--model", DEFAULT)]
    assert given[0][0]["detections"] == given[1][0]["detections"]
    assert DEFAULT in SHIPPED


def test_a_configuration_may_name_one(tmp_path):
    path = tmp_path / "vm.toml"
    path.write_text('model = "ball"\n')
    assert read_configuration(path).model == str(model_path("ball"))
    path.write_text('model = "mine.onnx"\n')
    assert read_configuration(path).model == str(tmp_path / "mine.onnx")


def test_a_network_has_its_name_only_in_the_package(tmp_path):
    assert [shipped_name(model_path(name)) for name in SHIPPED] == list(SHIPPED)
    assert shipped_name(tmp_path / "ball.onnx") is None


def test_a_robot_without_the_networks_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(bundled, "_FOLDER", tmp_path)
    with pytest.raises(InputError, match=r"network soccer is not installed.*etc/model\.onnx"):
        model_path("soccer")


def test_the_mesh_follows_the_ball():
    small = Detector.from_file(DEFAULT, Settings(object_radius=0.05))
    assert small.manifest.radius == small.manifest.object_radius == 0.05
    assert small.cache.shape == small.shape


def in_the_demo(*arguments):
    """Numbers of balls in the demo, of those found, and of false detections."""
    lines = detect("--camera", DEMO, *arguments)
    found = false = 0
    for line in lines:
        scene = json.loads((DEMO / line["source"].replace("image", "scene").replace(".jpg", ".json")).read_text())
        ball = scene["ball"]
        near = [
            np.hypot(*(np.array(each["center"]) - ball["pixel"])) < ball["pixel_radius"] for each in line["detections"]
        ]
        found += any(near)
        false += len(near) - any(near)
    return len(lines), found, false


@pytest.mark.parametrize("name", [DEFAULT, "soccer"])
def test_the_balls_of_the_demo_are_found(name):
    balls, found, false = in_the_demo("--model", name)
    assert balls == 12
    assert found >= 11
    assert false <= 1


def test_the_demo_shows_all_features_of_a_field():
    seen = [line["field"] for line in detect("--camera", DEMO, "--model", "soccer")]
    counts = {name: sum(len(each[name]) for each in seen) for name in ("posts", "robots", "lines", "crossings")}
    assert counts["posts"] >= 2
    assert counts["robots"] >= 6
    assert counts["lines"] >= 20
    assert counts["crossings"] >= 6
    assert sum(each["circle"] is not None for each in seen) >= 2
    assert sum(each["border"] is not None for each in seen) >= 5
