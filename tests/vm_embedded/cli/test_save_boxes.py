"""vm-detect --save-boxes: images, boxes in YOLO format, near misses."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.drawn_scenes import FOLDER, IMAGES, TRUTH

from .commands import detect, lines, one_complaint, run

DEMO = Path(__file__).parents[2] / "fixtures" / "demo"
SIZE = np.array([640, 512])


def boxes_of(path):
    """Classes (n,), and centers and sizes (n, 4) [px] with pixel centers at whole numbers."""
    rows = np.array([[float(word) for word in line.split()] for line in path.read_text().splitlines()]).reshape(-1, 5)
    return rows[:, 0].astype(int), rows[:, 1:] * np.tile(SIZE, 2) - (0.5, 0.5, 0.0, 0.0)


def candidates(folder):
    return [json.loads(line) for line in (folder / "candidates.jsonl").read_text().splitlines()]


def test_boxes_are_around_what_was_found(tmp_path):
    out = tmp_path / "boxes"
    found = lines(detect(FOLDER, "--save-boxes", out))
    truth = json.loads(TRUTH.read_text())
    assert (out / "classes.txt").read_text() == "ball\n"
    for line in found:
        source = FOLDER / line["source"]
        assert (out / source.name).read_bytes() == source.read_bytes()
        classes, boxes = boxes_of(out / f"{source.stem}.txt")
        assert len(boxes) == len(line["detections"]) > 0
        assert not classes.any()
        assert "rejected" not in line
        for box, detection in zip(boxes, line["detections"], strict=True):
            center = np.array(detection["center"])
            if (np.minimum(center, SIZE - center) > 1.2 * detection["radius"]).all():  # not cut off by the border
                np.testing.assert_allclose(box[:2], center, atol=1.5)
                np.testing.assert_allclose(box[2:], 2 * detection["radius"], rtol=0.15, atol=1)
        assert np.hypot(*(boxes[0, :2] - truth[source.name]["center"])) < boxes[0, 2:].max() / 2
    assert [each["confidence"] for each in candidates(out) if each["found"]] == [
        each["confidence"] for line in found for each in line["detections"]
    ]


def test_the_folder_is_processed_again_with_its_lens_and_pose(tmp_path):
    before = lines(detect(FOLDER, "--save-boxes", tmp_path / "boxes"))
    again = lines(detect(tmp_path / "boxes"))
    assert [each["detections"] for each in again] == [each["detections"] for each in before]


@pytest.mark.long
def test_near_misses_are_in_no_yolo_file(tmp_path):
    out = tmp_path / "boxes"
    found = lines(
        run("--camera", DEMO, "--min-confidence", 0.97, "--save-boxes", out, "--save-overlay", tmp_path / "a")
    )
    run("--camera", DEMO, "--min-confidence", 0.97, "--save-overlay", tmp_path / "b")
    near = [each for each in candidates(out) if not each["found"]]
    assert near
    assert all(0.05 <= each["confidence"] < 0.97 for each in near)
    labels = sum(len((out / f"{Path(line['source']).stem}.txt").read_text().splitlines()) for line in found)
    assert labels == sum(len(line["detections"]) for line in found) == sum(each["found"] for each in candidates(out))
    assert all(
        0 <= low <= high <= 1 for x, y, w, h in (each["box"] for each in near) for low, high in [(x - w / 2, x + w / 2)]
    )
    for drawn in (tmp_path / "a").iterdir():  # near misses are only drawn with --explain
        assert drawn.read_bytes() == (tmp_path / "b" / drawn.name).read_bytes()


def test_frames_of_a_video_become_lossless_images_of_their_own_names(tmp_path, lens):
    writer = cv2.VideoWriter(str(tmp_path / "clip.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (640, 512))
    for _ in range(3):
        writer.write(cv2.imread(str(IMAGES[0])))
    writer.release()
    pose = ("--height", 0.8, "--pitch", "30deg")
    before = lines(detect(tmp_path / "clip.avi", "--lens", lens, *pose, "--save-boxes", tmp_path / "boxes"))
    names = sorted(path.name for path in (tmp_path / "boxes").glob("*.png"))
    assert names == [f"image-clip-00000{i}.png" for i in range(3)]
    assert (tmp_path / "boxes" / "lens-clip-000002.yaml").exists()
    again = lines(detect(tmp_path / "boxes"))
    assert [each["detections"] for each in again] == [each["detections"] for each in before]


def test_images_with_one_name_stay_apart(tmp_path, lens):
    for name in ("a/frame.jpg", "b/frame.jpg", "b/frame.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        cv2.imwrite(str(tmp_path / name), cv2.imread(str(IMAGES[0])))
    pose = ("--lens", lens, "--height", 0.8, "--pitch", "30deg")
    detect(tmp_path / "*" / "frame.*", *pose, "--save-boxes", tmp_path / "boxes")
    stems = ["image-frame", "image-frame-2", "image-frame-3"]
    assert sorted(path.stem for path in (tmp_path / "boxes").glob("image*.txt")) == stems
    assert sorted(path.name for path in (tmp_path / "boxes").glob("image*.[jp][pn]g")) == [
        *("image-frame-2.jpg", "image-frame-3.png", "image-frame.jpg")
    ]
    assert len(list((tmp_path / "boxes").glob("lens*.yaml"))) == 3


def test_a_call_without_a_lens_can_be_repeated_with_one(tmp_path):
    shutil.copy(IMAGES[0], tmp_path / "photo.jpg")
    command = (tmp_path / "photo.jpg", "--save-boxes", tmp_path / "boxes")
    one_complaint(detect(*command, code=1), "no lens: give --lens or --fov")
    assert not any((tmp_path / "boxes").iterdir())
    detect(*command, "--fov", "70deg", "--height", 0.8)
    assert (tmp_path / "boxes" / "classes.txt").read_text() == "ball\n"


def test_labels_are_never_overwritten(tmp_path):
    (tmp_path / "boxes").mkdir()
    (tmp_path / "boxes" / "image0000000.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    one_complaint(detect(FOLDER, "--save-boxes", tmp_path / "boxes", code=1), "boxes: the folder is not empty")
    assert (tmp_path / "boxes" / "image0000000.txt").read_text() == "0 0.5 0.5 0.1 0.1\n"
    one_complaint(detect(FOLDER, "--save-boxes", TRUTH, code=1), "can't create folder")


def test_an_image_that_can_t_be_written_is_named_and_the_others_follow(tmp_path):
    frames = tmp_path / "frames"
    frames.mkdir()
    for image in IMAGES[:2]:
        shutil.copy(image, frames)
        shutil.copy(image.with_name(image.name.replace("image", "lens")).with_suffix(".yaml"), frames)
    (frames / "image0000007.jpg").write_bytes(b"broken")
    done = one_complaint(detect(frames, "--save-boxes", tmp_path / "boxes"), "image0000007.jpg")
    assert len(lines(done)) == 2
    assert len(list((tmp_path / "boxes").glob("image*.txt"))) == 2


@pytest.mark.parametrize("source", ["synthetic"])
def test_a_live_camera_says_what_to_do(source, tmp_path):
    done = run("--camera", source, "--save-boxes", tmp_path / "boxes", code=78)
    assert "--save-boxes works only with files" in done.stderr
    assert "make a recording" in done.stderr
    assert not (tmp_path / "boxes").exists()
