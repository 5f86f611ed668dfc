"""Pictures of crops: the box is in the middle, whatever its size and place."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_label.cutting import SIDE, cut, whole


def decoded(content):
    return cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.005, 1.0), st.floats(0.005, 1.0))
def test_the_box_is_in_the_middle(x, y, width, height):
    image = np.zeros((300, 500, 3), dtype=np.uint8)
    left, right = round((x - width / 2) * 500), round((x + width / 2) * 500)
    top, bottom = round((y - height / 2) * 300), round((y + height / 2) * 300)
    image[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)] = 255
    picture = decoded(cut(image, (x, y, width, height)))
    assert picture.shape == (SIDE, SIDE, 3)
    inside = 0 <= left < right - 4 and right <= 500 and 0 <= top < bottom - 4 and bottom <= 300
    if inside:
        assert picture[SIDE // 2, SIDE // 2].min() > 200
        rows, columns = np.nonzero(picture.min(axis=2) > 200)
        tolerance = 5 + 0.5 * 480 / 48  # a pixel of the image, and the line of the box
        assert (rows.min() + rows.max()) / 2 == pytest.approx(SIDE / 2, abs=tolerance)
        assert (columns.min() + columns.max()) / 2 == pytest.approx(SIDE / 2, abs=tolerance)


def test_what_is_outside_of_the_image_is_gray():
    picture = decoded(cut(np.zeros((100, 100, 3), np.uint8), (0.02, 0.5, 0.04, 0.2)))
    np.testing.assert_allclose(picture[SIDE // 2, 5], 128, atol=3)
    np.testing.assert_allclose(picture[SIDE // 2, -5], 0, atol=3)


@pytest.mark.parametrize("size", [(80, 60), (4000, 50), (60, 4000), (40, 40)])
def test_the_whole_picture_keeps_its_shape(size):
    width, height = size
    picture = decoded(whole(np.full((height, width, 3), 100, np.uint8)))
    assert max(picture.shape[:2]) == min(max(size), 2400)
    assert picture.shape[1] / picture.shape[0] == pytest.approx(width / height, rel=0.02)
    np.testing.assert_allclose(picture, 100, atol=2)
