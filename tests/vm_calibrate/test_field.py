"""vm-calibrate on pictures of a field: a photo, the frames of a fixed camera, and a recording with wrong poses."""

import json
import math
import shlex
import tomllib

import cv2
import numpy as np
import pytest

from tests.programs import run_program
from tests.vm_embedded.cli.test_detect_files import DEMO
from tests.vm_embedded.cli.test_wrong_poses import camera
from vm_embedded.detection.pose_search import corrected
from vm_embedded.geometry.lens_files import format_lens_file, read_lens_file

__all__ = ("camera",)  # a fixture


def test_one_photo_without_a_lens_file_gives_a_pose_with_which_its_ball_is_found(shared):
    photo = shared / "real" / "images" / "image0000034.jpg"
    done = run_program("vm-calibrate", "photo", photo, "--fov", "85deg", "--radius", 0.11)
    command = shlex.split(done.stdout.splitlines()[-1])
    assert command[0] == "vm-detect"
    assert "the balls give the height" in done.stdout
    found = json.loads(run_program(*command, "--json").stdout)["detections"]
    balls = json.loads((shared / "real" / "balls.json").read_text())[photo.name]
    nearest = min(balls, key=lambda each: each["dist"])
    assert min(math.dist(each["center"], (nearest["cx"], nearest["cy"])) for each in found) < nearest["r_px"]


def test_frames_of_a_fixed_camera_give_its_pose(camera, tmp_path):
    frames, lens, pose = camera
    written = tmp_path / "camera.yaml"
    done = run_program("vm-calibrate", "pose", frames, "--field", "--lens", lens, "--radius", 0.11, "-o", written)
    found = read_lens_file(written).orientation
    assert found.height == pytest.approx(pose.height, rel=0.1)
    assert math.degrees(found.pitch - pose.pitch) == pytest.approx(0.0, abs=2.5)
    assert math.degrees(found.roll - pose.roll) == pytest.approx(0.0, abs=2.5)
    assert "pieces of lines" in done.stdout


def test_a_recording_gives_the_correction_of_all_its_poses(tmp_path):
    """The frames are of several cameras, whose poses have one error in common."""
    error = np.array([math.radians(4.0), math.radians(-3.0), 0.0, 0.0])
    folder = tmp_path / "recording"
    folder.mkdir()
    for image in sorted(DEMO.parent.glob("image*.jpg")):
        name = image.name.replace("image", "lens").replace(".jpg", ".yaml")
        known = read_lens_file(image.with_name(name))
        (folder / name).write_text(format_lens_file(known.lens, corrected(known.orientation, -error)))
        cv2.imwrite(str(folder / image.name), cv2.imread(str(image)))
    written = tmp_path / "vm.toml"
    run_program("vm-calibrate", "pose", folder, "--field", "-o", written)
    section = tomllib.loads(written.read_text())["pose"]
    assert math.degrees(section["add_pitch"]) == pytest.approx(4.0, abs=0.6)
    assert math.degrees(section["add_roll"]) == pytest.approx(-3.0, abs=0.6)
    assert section["scale_height"] == pytest.approx(1.0, abs=0.1)
    again = run_program("vm-calibrate", "pose", folder, "--field", "-o", tmp_path / "a.yaml", code=1)
    assert "the poses of the frames differ" in again.stderr


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("photo", "a.jpg"), "give --lens FILE, or --fov ANGLE"),
        (("photo", "a.jpg", "--fov", "70deg", "--radius", 7), "--radius must be a length above 0 and up to 1 m"),
        (("pose", "a.jpg", "--field", "--square", 0.1, "-o", "b.yaml"), "--field does not use --square"),
        (("pose", "-o", "b.yaml"), "one of them"),
    ],
)
def test_what_can_not_be_used_is_refused(options, says, tmp_path):
    cv2.imwrite(str(tmp_path / "a.jpg"), np.zeros((64, 64, 3), np.uint8))
    assert says in run_program("vm-calibrate", *options, code=1, cwd=tmp_path).stderr


def test_a_photo_of_nothing_gives_no_pose(tmp_path):
    cv2.imwrite(str(tmp_path / "a.jpg"), np.full((480, 640, 3), 90, np.uint8))
    done = run_program("vm-calibrate", "photo", "a.jpg", "--fov", "70deg", code=1, cwd=tmp_path)
    assert "the frames show only 0 pieces of lines and 0 balls" in done.stderr
