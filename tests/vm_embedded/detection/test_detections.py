"""Results as a user of the Python interface meets them: printed, as JSON, drawn and saved."""

import json

import cv2
import pytest

from tests.drawn_scenes import IMAGES, MODEL
from vm_embedded import Detector, draw_overlay, read_lens_file


@pytest.fixture(scope="module")
def image():
    return cv2.imread(str(IMAGES[0]))


@pytest.fixture(scope="module")
def detections(image):
    camera = read_lens_file(IMAGES[0].with_name(IMAGES[0].name.replace("image", "lens")).with_suffix(".yaml"))
    return Detector.from_file(MODEL).detect(image, camera.orientation, camera.lens, explain=True)


def test_printed_detections_are_short(detections):
    assert len(detections) > 0
    assert len(f"{detections}") < 100 + 100 * len(detections)
    for each in detections:
        assert "\n" not in f"{each}"
        assert f"{each}".startswith(f"<{each.class_name} {each.confidence:.2f} {each.distance:.2f} m at (")
    assert [f"{each}".endswith(f"rejected: {each.reason}>") for each in detections.rejected].count(False) == 0


def test_detections_as_json_are_those_of_vm_detect(detections):
    data = json.loads(json.dumps(detections.as_dict(), allow_nan=False))
    assert list(data) == ["points", "detections", "field", "timing_ms"]
    assert data["points"] == len(detections.pixels)
    assert [each["class"] for each in data["detections"]] == [each.class_name for each in detections]


def test_detections_are_drawn_and_saved(image, detections, tmp_path):
    drawn = draw_overlay(image, detections)
    assert drawn.shape == image.shape
    assert (drawn != image).any()
    assert cv2.imwrite(str(tmp_path / "found.jpg"), drawn)
