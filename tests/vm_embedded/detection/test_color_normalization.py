"""Relative colors: light and camera make no difference, and robot and training make them alike."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.detection.detector import Detector
from vm_embedded.detection.sampling import normalized
from vm_embedded.detection.settings import Settings
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.network.model_file import read_model

DRAWN = Path(__file__).parents[2] / "fixtures" / "drawn"
seeds = st.integers(0, 2**31)


def colors_of(seed, count=200):
    return np.random.default_rng(seed).random((3, count), dtype=np.float32)


@given(seeds, st.floats(0.2, 5.0), st.floats(-0.5, 0.5))
def test_light_and_haze_make_no_difference(seed, gain, haze):
    colors = colors_of(seed)
    other = np.float32(gain) * colors + np.float32(haze)
    np.testing.assert_allclose(normalized(other, "relative"), normalized(colors, "relative"), atol=1e-3)


@given(seeds)
def test_they_have_no_mean_and_a_deviation_of_one(seed):
    colors = normalized(colors_of(seed), "relative")
    np.testing.assert_allclose(colors.mean(axis=1), 0.0, atol=1e-5)
    np.testing.assert_allclose(colors.std(axis=1), 1.0, atol=1e-4)


@given(seeds, st.randoms(use_true_random=False))
def test_only_what_counts_decides_and_its_order_does_not(seed, random):
    colors = colors_of(seed)
    counted = np.arange(200) < 120
    mixed = np.where(counted, colors, np.float32(100.0) * colors)
    order = list(range(200))
    random.shuffle(order)
    found = normalized(mixed, "relative", counted)
    np.testing.assert_array_equal(found[:, :120], normalized(colors[:, :120], "relative"))
    np.testing.assert_array_equal(normalized(mixed[:, order], "relative", counted[order]), found[:, order])


def test_a_picture_of_nothing_keeps_its_noise_small():
    for colors in (np.full((3, 50), 0.3, dtype=np.float32), np.empty((3, 0), dtype=np.float32)):
        assert np.abs(normalized(colors, "relative")).max(initial=0.0) < 1e-5
    nothing = colors_of(3)
    np.testing.assert_array_equal(normalized(nothing, "relative", np.zeros(200, dtype=bool)), nothing)


def test_absolute_colors_stay():
    colors = colors_of(4)
    np.testing.assert_array_equal(normalized(colors, "absolute"), colors)


@pytest.mark.parametrize("gain", [1.0, 0.5])
def test_a_robot_gives_its_network_what_a_training_does(gain):
    """All points of a picture at its own pose, in a picture half as bright too."""
    from vm_export.grid import VISUAL
    from vm_train.data.pictures import Picture
    from vm_train.evaluation.answers import ExactSubject

    model = read_model(DRAWN / "ball.onnx")
    model = replace(model, manifest=replace(model.manifest, colors="relative", self_test=None))
    given = read_lens_file(DRAWN / "lens0000002.yaml")
    pose = given.orientation  # without its yaw, which a training takes out and this detector's own meshes follow
    lens = replace(given, orientation=Orientation.from_roll_pitch(pose.height, pose.roll, pose.pitch))
    image = (gain * cv2.imread(str(DRAWN / "image0000002.jpg"))).round().astype(np.uint8)
    detector = Detector(model, Settings(height_tolerance=0.0))
    robot = detector.detect(image, lens.orientation, lens.lens)
    labels = np.zeros(image.shape[:2], dtype=np.int8)
    training = ExactSubject(model.manifest, VISUAL, "", Settings(), detector.session)
    answer = training.answer(Picture(image, labels, lens))
    assert len(answer.pixels) == len(robot.pixels) > 500
    ours, theirs = (
        each[np.lexsort(np.round(at, 3).T)]
        for each, at in ((robot.probabilities, robot.pixels), (answer.probabilities, answer.pixels))
    )
    np.testing.assert_allclose(ours, theirs, atol=1e-4)
    plain = Detector(
        replace(model, manifest=replace(model.manifest, colors="absolute")), Settings(height_tolerance=0.0)
    )
    assert np.abs(plain.detect(image, lens.orientation, lens.lens).probabilities - robot.probabilities).max() > 0.1
