"""The halved copies of a frame: what a pixel of each shows, and that the order of asking changes nothing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.detection.pyramid import Pyramid


def frame(seed, width, height, channels=3):
    shape = (height, width, channels) if channels > 1 else (height, width)
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


def middle_of(image, times):
    """Means of the four pixels in the middle of each square of so many pixels."""
    height, width = (side // times for side in image.shape[:2])
    low, high = times // 2 - 1, times // 2
    rows = [image[each : times * height : times] for each in (low, high)]
    parts = [row[:, each : times * width : times].astype(float) for row in rows for each in (low, high)]
    return np.mean(parts, axis=0)


@given(st.integers(0, 99), st.integers(8, 60), st.integers(8, 60), st.sampled_from([1, 3, 4]))
def test_a_pixel_is_the_mean_of_the_middle_of_what_it_replaces(seed, width, height, channels):
    image = frame(seed, width, height, channels)
    made = Pyramid(image, {1: "gray", 3: "bgr", 4: "bgra"}[channels])
    np.testing.assert_array_equal(made.level(0), image)
    for number, source, times in ((1, image, 2), (2, image, 4), (3, made.level(2), 2)):
        found = made.level(number)
        assert found.shape[:2] == (height >> number, width >> number)
        np.testing.assert_allclose(found, middle_of(source, times), atol=0.51)


@given(st.integers(0, 99), st.permutations(range(6)))
def test_the_order_of_asking_changes_nothing(seed, order):
    image = frame(seed, 64, 48)
    one, other = Pyramid(image, "bgr"), Pyramid(image, "bgr")
    for number in order:
        other.level(number)
    for number in order:
        np.testing.assert_array_equal(one.level(number), other.level(number))


@given(st.integers(0, 99), st.integers(0, 4), st.floats(-9.0, 70.0), st.floats(-9.0, 70.0), st.floats(0.0, 30.0))
def test_a_part_of_the_frame_gives_the_colors_of_the_whole(seed, number, left, top, width):
    image = frame(seed, 91, 67)
    whole, made = Pyramid(image, "bgr"), Pyramid(image, "bgr")
    whole.level(1)
    x, y = np.meshgrid(np.linspace(left, left + width, 5), np.linspace(top, top + 8.0, 4))
    x, y = x.astype(np.float32), y.astype(np.float32)
    expected = whole.at(number, x, y)
    np.testing.assert_array_equal(made.at(number, x, y), expected)
    seen = y < top + 4.0
    np.testing.assert_array_equal(made.at(number, x, y, seen)[seen], expected[seen])


@pytest.mark.parametrize(("width", "height"), [(2, 2), (3, 40), (40, 3), (5, 7)])
def test_a_tiny_frame_becomes_one_pixel_wide_at_least(width, height):
    made = Pyramid(frame(1, width, height), "bgr")
    assert all(min(made.level(number).shape) >= 1 for number in range(8))
