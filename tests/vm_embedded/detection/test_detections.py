"""Results as a user of the Python interface meets them: printed, as JSON, drawn and saved."""

import csv
import json
import math
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.drawn_scenes import IMAGES, MODEL
from vm_embedded import (
    Detections,
    Detector,
    InputError,
    Orientation,
    Rectilinear,
    Settings,
    Track,
    read_lens_file,
)
from vm_embedded.detection.detections import COLUMNS
from vm_embedded.network.manifest import ObjectClass

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
    assert list(data) == ["points", "detections", "field", "pose", "timing_ms"]
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


TRACK = Track(7, "cup", 0.0, np.zeros(3), np.zeros(2), np.eye(4), 3)


@pytest.fixture(scope="module")
def several(detections):
    """Detections of four objects of two classes, one of them beyond the edge of the image and one unseen."""
    (ball,) = detections
    objects = [
        ball,
        replace(ball, confidence=0.5, distance=4.0, outline=ball.outline - ball.outline.min(axis=0) - 3.0),
        replace(ball, class_name="cup", confidence=0.4, distance=2.0, track=TRACK),
        replace(ball, confidence=0.3, distance=9.0, outline=np.empty((0, 2)), radius=0.0),
    ]
    classes = *detections.manifest.classes, ObjectClass("cup", "object")
    manifest = replace(detections.manifest, classes=classes)
    return replace(detections, objects=tuple(objects), observation=replace(detections.observation, manifest=manifest))


def test_boxes_hold_the_outlines_and_end_at_the_image(several):
    boxes = several.xyxy
    assert boxes.shape == (4, 4)
    for box, each in zip(boxes[[0, 2]], (several[0], several[2]), strict=True):
        np.testing.assert_allclose(box, [*each.outline.min(axis=0) + 0.5, *each.outline.max(axis=0) + 0.5])
        assert (box[:2] < each.center).all()
        assert (each.center < box[2:]).all()
    assert boxes[1, :2].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(boxes[1, 2:], several[1].outline.max(axis=0) + 0.5)
    np.testing.assert_allclose(boxes[3], np.tile(several[3].center, 2) + 0.5)
    assert several[:0].xyxy.shape == (0, 4)


def test_a_slice_and_a_filter_keep_everything_but_the_other_objects(several):
    for some, kept in ((several[1:], several.objects[1:]), (several.filter("cup"), several.objects[2:3])):
        assert isinstance(some, Detections)
        assert some.objects == kept
        assert len(some) == len(kept)
        assert some.observation is several.observation
        assert some.field is several.field
    assert several[-1] is several.objects[-1]


def test_what_a_filter_leaves_out_is_not_drawn(detections):
    none = detections.filter(max_distance=0.1)
    assert len(none) == 0
    assert none.timing_ms == detections.timing_ms
    assert (none.draw() != detections.draw()).any()


@pytest.mark.parametrize(
    ("arguments", "kept"),
    [
        ({}, (0, 1, 2, 3)),
        ({"class_name": "ball"}, (0, 1, 3)),
        ({"class_name": ("ball", "cup")}, (0, 1, 2, 3)),
        ({"min_confidence": 0.4}, (0, 1, 2)),
        ({"max_distance": 4.0}, (0, 1, 2)),
        ({"min_distance": 2.0, "max_distance": np.float32(8.0)}, (1, 2)),
        ({"class_name": {"ball"}, "min_confidence": 0.4, "min_distance": 3.0}, (1,)),
        ({"class_name": []}, ()),
    ],
)
def test_filter(several, arguments, kept):
    assert several.filter(**arguments).objects == tuple(several.objects[each] for each in kept)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"class_name": "bal"}, "did you mean 'ball'"),
        ({"class_name": ("cup", "line")}, "'line'"),
        ({"class_name": 0.5}, "0.5"),
        ({"min_confidence": "0.5"}, "min_confidence"),
        ({"max_distance": math.nan}, "max_distance"),
        ({"min_distance": None}, "min_distance"),
    ],
)
def test_a_filter_that_can_not_be_is_refused(several, arguments, named):
    with pytest.raises(InputError, match=named):
        several.filter(**arguments)


def test_rows_are_flat_and_say_what_the_json_says(several):
    rows = several.to_rows()
    assert {tuple(each) for each in rows} == {COLUMNS}
    for row, each, box in zip(rows, several, several.xyxy, strict=True):
        data = each.as_dict()
        assert [row["x"], row["y"], row["z"]] == data["position"]
        assert [row["center_x"], row["center_y"]] == data["center"]
        assert [row["xmin"], row["ymin"], row["xmax"], row["ymax"]] == box.round(1).tolist()
        assert {name: row[name] for name in COLUMNS if name in data and name != "track"} == {
            name: data[name] for name in COLUMNS if name in data and name != "track"
        }
    assert [each["track"] for each in rows] == [None, None, 7, None]
    assert all(isinstance(value, str | int | float | None) for row in rows for value in row.values())


def test_a_table_is_saved(several, tmp_path):
    odd = replace(several, objects=(replace(several[0], class_name='a, "b"'), *several.objects[1:]))
    odd.save(tmp_path / "found.CSV")
    with (tmp_path / "found.CSV").open(newline="", encoding="utf-8") as file:
        read = list(csv.DictReader(file))
    assert read == [{name: "" if value is None else str(value) for name, value in row.items()} for row in odd.to_rows()]
    several[:0].save(str(tmp_path / "none.csv"))
    assert (tmp_path / "none.csv").read_text() == ",".join(COLUMNS) + "\n"


def test_pandas_takes_the_rows(several):
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(several.to_rows())
    assert tuple(table.columns) == COLUMNS
    assert table.groupby("class").size().to_dict() == {"ball": 3, "cup": 1}


def test_supervision_gets_the_objects(several):
    supervision = pytest.importorskip("supervision")
    made = several.to_supervision()
    assert isinstance(made, supervision.Detections)
    np.testing.assert_array_equal(made.xyxy, several.xyxy)
    assert made.class_id.tolist() == [0, 0, 1, 0]
    assert made.tracker_id.tolist() == [-1, -1, 7, -1]
    assert made[made.confidence > 0.45].data["class_name"].tolist() == ["ball", "ball"]
    assert made.data["position"].shape == (4, 3)
    assert several[:2].to_supervision().tracker_id is None
    assert len(several[:0].to_supervision()) == 0


def test_without_supervision_the_error_says_how_to_install_it(several, monkeypatch):
    monkeypatch.setitem(sys.modules, "supervision", None)  # an import of it fails, as where it is not installed
    with pytest.raises(InputError, match="pip install supervision"):
        several.to_supervision()
