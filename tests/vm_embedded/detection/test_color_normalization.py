"""Relative colors: light and camera make no difference, and robot and training make them alike."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.detection.color_normalization import normalize_colors
from vm_embedded.detection.detector import Detector
from vm_embedded.detection.settings import Settings
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.network.model_file import read_model

DRAWN = Path(__file__).parents[2] / "fixtures" / "drawn"
seeds = st.integers(0, 2**31)


def colors_of(seed, count=200):
    return np.random.default_rng(seed).random((count, 3), dtype=np.float32)


@given(seeds, st.floats(0.2, 5.0), st.floats(-0.5, 0.5))
def test_light_and_haze_make_no_difference(seed, gain, haze):
    colors = colors_of(seed)
    other = np.float32(gain) * colors + np.float32(haze)
    normalize_colors(colors, "relative")
    normalize_colors(other, "relative")
    np.testing.assert_allclose(other, colors, atol=1e-3)


@given(seeds)
def test_they_have_no_mean_and_a_deviation_of_one(seed):
    colors = colors_of(seed)
    normalize_colors(colors, "relative")
    np.testing.assert_allclose(colors.mean(axis=0), 0.0, atol=1e-5)
    np.testing.assert_allclose(colors.std(axis=0), 1.0, atol=1e-4)


@given(seeds, st.randoms(use_true_random=False))
def test_only_what_counts_decides_and_its_order_does_not(seed, random):
    colors = colors_of(seed)
    counted = np.arange(200) < 120
    mixed = np.concatenate([colors[:120], 100.0 * colors[120:]])
    order = list(range(200))
    random.shuffle(order)
    shuffled = mixed[order]
    alone = colors[:120].copy()
    normalize_colors(alone, "relative")
    normalize_colors(mixed, "relative", counted)
    normalize_colors(shuffled, "relative", counted[order])
    np.testing.assert_array_equal(mixed[:120], alone)
    np.testing.assert_array_equal(shuffled, mixed[order])


def test_a_picture_of_nothing_keeps_its_noise_small():
    for colors in (np.full((50, 3), 0.3, dtype=np.float32), np.empty((0, 3), dtype=np.float32)):
        normalize_colors(colors, "relative")
        assert np.abs(colors).max(initial=0.0) < 1e-5
    nothing = colors_of(3)
    before = nothing.copy()
    normalize_colors(nothing, "relative", np.zeros(200, dtype=bool))
    np.testing.assert_array_equal(nothing, before)


def test_absolute_colors_stay():
    colors = colors_of(4)
    before = colors.copy()
    normalize_colors(colors, "absolute")
    np.testing.assert_array_equal(colors, before)


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
