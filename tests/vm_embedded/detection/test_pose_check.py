"""The check of the pose: rendered pictures of a field agree with their true poses, and speak against wrong ones."""

import math
from functools import cache

import cv2
import numpy as np
import pytest

from tests.vm_embedded.cli.test_detect_files import DEMO
from vm_embedded import Detector, Orientation, read_lens_file
from vm_embedded.detection.pose_check import PoseCheck
from vm_embedded.detection.pose_search import View, corrected, with_search
from vm_embedded.detection.pose_state import PoseState
from vm_embedded.geometry.radial_lenses import Rectilinear

PICTURES = sorted(DEMO.parent.glob("image*.jpg"))


@cache
def detector():
    return Detector.from_file("soccer")


@cache
def views():
    files = [
        read_lens_file(each.with_name(each.name.replace("image", "lens")).with_suffix(".yaml")) for each in PICTURES
    ]
    return [
        View(cv2.imread(str(each)), file.lens, file.orientation) for each, file in zip(PICTURES, files, strict=True)
    ]


def assumed(pitch=0.0, roll=0.0, height=1.0):
    """The views with poses that have these errors [deg], and this factor of the height."""
    errors = np.array([math.radians(pitch), math.radians(roll), math.log(height), 0.0])
    return [View(each.image, each.lens, corrected(each.orientation, -errors)) for each in views()]


def state_after(seen):
    check = PoseCheck()
    for each in seen:
        found = check.update(detector().detect(each.image, each.orientation, each.lens))
    assert found.pose == check.state
    return check.state


def test_right_poses_are_consistent():
    state = state_after(views())
    assert state.verdict == "consistent"
    assert abs(state.pitch) < 1.0
    assert abs(state.roll) < 1.0
    assert state.lines > 20
    assert state.frames == len(PICTURES)


@pytest.mark.parametrize("error", [4.0, -4.0])
def test_an_error_of_all_pitches_is_found(error):
    state = state_after(assumed(pitch=error))
    assert state.verdict in ("doubtful", "wrong")
    assert state.pitch == pytest.approx(error, abs=2.0)


@pytest.mark.parametrize("error", [4.0, -4.0])
def test_an_error_of_all_rolls_is_seen_by_a_dozen_pictures(error):
    state = state_after(assumed(roll=error))
    assert state.verdict != "consistent"
    assert state.roll == pytest.approx(error, abs=2.0)


def test_a_picture_that_is_seen_again_tells_nothing_more():
    first = views()[2]
    assert state_after([first]) == state_after([first] * 20)


def test_an_empty_carpet_leaves_the_pose_unknown():
    random = np.random.default_rng(0)
    lens = Rectilinear.from_horizontal_fov(1.0, (640, 480))
    carpets = [
        View(random.normal((60, 120, 50), 6.0, (480, 640, 3)).clip(0, 255).astype(np.uint8), lens, pose)
        for pose in [Orientation.from_roll_pitch(0.6, 0.0, 0.9)] * 12
    ]
    state = state_after(carpets)
    assert state.verdict == "unknown"
    assert state.pitch is None
    assert state.roll is None
    assert state.height is None
    assert with_search(state, detector(), carpets[:2]) == state


def test_a_search_finds_an_error_that_is_too_large_for_the_check():
    found = with_search(PoseState(verdict="unknown"), detector(), assumed(pitch=17.0)[:5])
    assert found.verdict == "wrong"
    assert found.pitch == pytest.approx(17.0, abs=5.0)


def test_a_correction_slowly_takes_an_error_out():
    seen, check = assumed(pitch=2.0), PoseCheck(corrects=True)
    added = []
    for each in 8 * seen:
        pose = check.corrected(each.orientation)
        added.append(check.update(detector().detect(each.image, pose, each.lens)).pose.added_pitch)
    assert added[0] == 0.0
    assert max(abs(np.diff(added))) < 0.3
    assert added[-1] == pytest.approx(2.0, abs=0.5)
    assert check.state.verdict == "consistent"
    far = PoseCheck(corrects=True)
    for each in 8 * assumed(pitch=6.0):
        far.update(detector().detect(each.image, far.corrected(each.orientation), each.lens))
    assert far.state.added_pitch == pytest.approx(3.0)
    assert far.state.verdict == "wrong"


def test_a_corrected_pose_keeps_its_yaw():
    pose = Orientation.from_roll_pitch(0.5, 0.1, 0.3, 2.0)
    better = corrected(pose, np.array([0.02, -0.01, math.log(1.1), 0.3]))
    assert (better.yaw, better.pitch, better.roll, better.height) == pytest.approx((2.0, 0.32, 0.09, 0.55))
