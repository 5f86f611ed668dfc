"""All programs turn an image as its EXIF entry says, and mean the same pixels."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.programs import run_program
from tests.vm_embedded.cameras.test_exif import written
from tests.vm_embedded.cli.commands import lines
from vm_embedded.cameras.image_files import read_image
from vm_embedded.geometry.lens_files import read_lens_file
from vm_label.answers import AnswerFile
from vm_label.box_folder import read_box_folder
from vm_label.labeling import Labeling
from vm_train.boxes.read import read_boxes
from vm_train.data.classes import Classes
from vm_train.data.pictures import find_pictures, read_picture

DEMO = Path(__file__).parent / "fixtures/demo"
FORMATS = [(1, ".png"), (3, ".png"), (6, ".png"), (8, ".webp"), (5, ".tif"), (6, ".tif"), (7, ".png")]
BACK = {1: [], 3: [-1], 5: ["T"], 6: [1, "T"], 7: [-1, "T"], 8: [0, "T"]}
"""How an image becomes one that a camera stores with an orientation: transposed (T) and flipped as in cv2.flip."""


def stored(image, orientation):
    for step in BACK[orientation]:
        image = np.swapaxes(image, 0, 1) if step == "T" else cv2.flip(image, step)
    return np.ascontiguousarray(image)


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    """One picture in several files, each stored turned in another way."""
    folder = tmp_path_factory.mktemp("turned") / "photos"
    folder.mkdir()
    image = read_image(DEMO / "image0000002.jpg")
    for number, (orientation, suffix) in enumerate(FORMATS):
        (folder / f"image{number}{suffix}").write_bytes(written(suffix, orientation, stored(image, orientation)))
        shutil.copy(DEMO / "lens0000002.yaml", folder / f"lens{number}.yaml")
    return folder


@pytest.fixture(scope="module")
def boxes(photos):
    """What vm-detect saves of them."""
    folder = photos.with_name("boxes")
    done = run_program("vm-detect", "--camera", photos, "--save-boxes", folder)
    return folder, [each["detections"] for each in lines(done)]


def test_vm_detect_finds_the_same_in_all_of_them(photos, boxes):
    upright, *others = boxes[1]
    assert upright
    for other in others:
        assert other == upright
    labels = [path.read_text() for path in sorted(boxes[0].glob("image*.txt"))]
    assert len(labels) == len(FORMATS)
    assert len(set(labels)) == 1


def test_vm_label_shows_the_same_crops_of_all_of_them(boxes):
    folder = read_box_folder(boxes[0])
    assert not folder.problems
    with AnswerFile(boxes[0]) as file:
        session = Labeling(folder, {}, file)
        shares = folder.crops[0].shares
        crops = [each.id for each in folder.crops if each.shares == shares]
        assert len(crops) == len(FORMATS)
        wholes = [each["id"] for each in session.state()["pictures"]]
        for ids in (crops, wholes):
            assert len({session.picture(session.find(each)) for each in ids}) == 1


def test_vm_train_reads_the_same_boxes_and_lens_of_all_of_them_and_makes_the_same_masks(boxes, tmp_path):
    found = read_boxes(boxes[0])
    first = found.pictures[0]
    # One content in several formats is not the same file, so no picture is left out.
    assert len(found.pictures) == len(FORMATS)
    assert {(each.size, each.boxes, each.lens is None) for each in found.pictures} == {(first.size, first.boxes, False)}
    (tmp_path / "train.toml").write_text(
        '[classes]\nball = { kind = "object", colors = [[255, 0, 0]] }\n'
        'other = { kind = "background", colors = [[0, 0, 0]] }\n'
    )
    options = ("--object-radius", 0.07, "--config", tmp_path / "train.toml")
    run_program("vm-train", "import-boxes", boxes[0], tmp_path / "out", *options)
    classes = Classes({"ball": ((255, 0, 0),), "other": ((0, 0, 0),)})
    pictures = [read_picture(each, classes) for each in find_pictures(tmp_path / "out")]
    assert len(pictures) == len(FORMATS)
    for each in pictures:
        np.testing.assert_array_equal(each.image, pictures[0].image)
        np.testing.assert_array_equal(each.labels, pictures[0].labels)
    assert (pictures[0].labels == classes.names.index("ball")).any()


def test_vm_calibrate_measures_balls_in_the_turned_picture(shared, tmp_path):
    case = shared / "cases/exif-turned"
    if not case.is_dir():
        pytest.skip("needs ../shared/cases")
    options = ("--lens", case / "lens.toml", "--radius", 0.11, "-o", tmp_path / "pose.yaml")
    run_program("vm-calibrate", "pose", "--balls", case / "boxes-of-a-tool", *options)
    assert read_lens_file(tmp_path / "pose.yaml").orientation.height == pytest.approx(0.77, abs=0.05)
