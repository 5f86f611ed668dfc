"""Results as a user of the Python interface meets them: printed, as JSON, drawn and saved."""

import json
import subprocess
import sys

import cv2
import numpy as np
import pytest

from tests.drawn_scenes import IMAGES, MODEL
from vm_embedded import Detector, InputError, Orientation, Rectilinear, Settings, read_lens_file

LENS = IMAGES[0].with_name(IMAGES[0].name.replace("image", "lens")).with_suffix(".yaml")


@pytest.fixture(scope="module")
def image():
    return cv2.imread(str(IMAGES[0]))


@pytest.fixture(scope="module")
def detections(image):
    camera = read_lens_file(LENS)
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
    before = image.copy()
    drawn = detections.draw(image)
    assert drawn.shape == image.shape
    assert (drawn != image).any()
    assert (image == before).all()
    assert (detections.draw() == drawn).all()
    detections.save(tmp_path / "found.png")
    assert (cv2.imread(str(tmp_path / "found.png")) == drawn).all()
    detections.save(str(tmp_path / "found.json"))
    assert json.loads((tmp_path / "found.json").read_text()) == json.loads(detections.to_json()) == detections.as_dict()


SCRIPT = """
import sys, cv2
from vm_embedded import Detector, read_lens_file
model, image, lens, *outputs = sys.argv[1:]
camera = read_lens_file(lens)
detections = Detector.from_file(model).detect(cv2.imread(image), camera.orientation, camera.lens)
for each in outputs:
    detections.save(each)
"""


def test_pictures_of_all_formats_are_saved_without_a_warning_of_opencv(tmp_path):
    """In a process of its own, because vm-detect silences OpenCV in that of the tests."""
    outputs = [tmp_path / f"found{suffix}" for suffix in (".jpg", ".JPEG", ".png", ".webp", ".bmp", ".tif", ".tiff")]
    command = [sys.executable, "-c", SCRIPT, MODEL, IMAGES[0], LENS, *outputs]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert {cv2.imread(str(each)).shape for each in outputs} == {(512, 640, 3)}
    assert outputs[0].read_bytes() == outputs[1].read_bytes()


def test_what_can_not_be_drawn_or_saved_is_refused(image, detections, tmp_path):
    for wrong in (image[1:], image.astype("float32"), image[:, :, :2]):
        with pytest.raises(InputError, match="image must"):
            detections.draw(wrong)
    with pytest.raises(InputError, match=r"suffix '.jpgg'; did you mean '.jpg'"):
        detections.save(tmp_path / "found.jpgg")
    with pytest.raises(InputError, match="can't write"):
        detections.save(tmp_path / "nowhere" / "found.jpg")
    assert not list(tmp_path.iterdir())


def test_a_picture_that_is_too_large_for_its_format_or_for_opencv_is_refused(tmp_path):
    detector, pose = Detector.from_file(MODEL), Orientation.from_roll_pitch(0.6, pitch=0.4)
    lens = Rectilinear(focal_length=9000.0, fov=1.5)
    wide = detector.detect(np.zeros((2, 16384, 3), np.uint8), pose, lens)
    with pytest.raises(InputError, match=r"can't write .*found.webp: .* at most 16383 px"):
        wide.save(tmp_path / "found.webp")
    assert not list(tmp_path.iterdir())
    detector.detect(np.zeros((32766, 2, 3), np.uint8), pose, lens)
    for shape in ((32767, 2, 3), (2, 32767, 3)):
        with pytest.raises(InputError, match=rf"to 32766 x 32766 px, not {shape[1]} x {shape[0]}"):
            detector.detect(np.zeros(shape, np.uint8), pose, lens)


@pytest.mark.parametrize(("format", "code"), [("rgb", cv2.COLOR_BGR2RGB), ("rgba", cv2.COLOR_BGR2RGBA)])
def test_other_pixel_formats_are_drawn_in_their_colors(image, detections, format, code):
    camera = read_lens_file(LENS)
    detector = Detector.from_file(MODEL, Settings(format=format))
    found = detector.detect(cv2.cvtColor(image, code), camera.orientation, camera.lens, explain=True)
    assert (found.draw() == detections.draw()).all()


def test_a_missing_image_is_an_error_of_the_user(tmp_path):
    camera, detector = read_lens_file(LENS), Detector.from_file(MODEL)
    with pytest.raises(InputError, match="can't read"):
        detector.detect(cv2.imread(str(tmp_path / "none.jpg")), camera.orientation, camera.lens)


def test_a_lens_file_without_orientation_is_an_error_of_the_user(image):
    with pytest.raises(InputError, match="no orientation"):
        Detector.from_file(MODEL).detect(image, None, read_lens_file(LENS).lens)
