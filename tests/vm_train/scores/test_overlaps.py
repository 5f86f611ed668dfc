"""The share of pixels inside outlines, against formulas."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_train.scores.overlaps import coverage

SQUARE = np.array([(5.0, 5.0), (13.0, 5.0), (13.0, 13.0), (5.0, 13.0)]) - 0.5
"""Around 8 x 8 pixels."""


def circle(x, y, radius, corners=256):
    turn = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    return np.stack([x + radius * np.cos(turn), y + radius * np.sin(turn)], axis=1)


@given(st.floats(0.3, 40.0), st.floats(-20.0, 80.0), st.floats(-20.0, 60.0))
def test_a_disk_covers_its_area_where_it_is_in_the_picture(radius, x, y):
    window, share = coverage(circle(x, y, radius), (60, 40))
    assert (share >= -1e-9).all()
    assert (share <= 1.0 + 1e-9).all()
    rows, columns = np.mgrid[window]
    far = np.hypot(columns - x, rows - y) - radius
    assert share[far < -0.75] == pytest.approx(1.0)
    assert share[far > 0.75] == pytest.approx(0.0, abs=1e-9)
    if radius > 2.0 and radius < x < 59 - radius and radius < y < 39 - radius:
        assert share.sum() == pytest.approx(math.pi * radius**2, rel=0.01)


@given(st.floats(-1e9, 1e9), st.floats(1.0, 1e12))
def test_outlines_far_beyond_the_picture_are_cut_at_its_border(x, side):
    corners = np.array([(x, -side), (x + side, -side), (x + side, side), (x, side)])
    window, share = coverage(corners, (60, 40))
    mask = np.zeros((40, 60))
    mask[window] = share
    columns = np.arange(60)
    inside = np.clip(columns + 0.5 - x, 0.0, 1.0) - np.clip(columns + 0.5 - (x + side), 0.0, 1.0)
    assert mask[0] == pytest.approx(inside, abs=1e-3)


@pytest.mark.parametrize("corners", [[], [(1.0, 1.0), (9.0, 9.0)], [(1.0, 1.0), (math.nan, 3.0), (9.0, math.inf)]])
def test_outlines_of_less_than_three_corners_cover_nothing(corners):
    assert coverage(np.array(corners, dtype=float).reshape(-1, 2), (60, 40))[1].sum() == 0.0


def test_a_corner_that_the_lens_does_not_see_is_left_out():
    assert coverage(np.insert(SQUARE, 1, math.nan, axis=0), (60, 40))[1].sum() == pytest.approx(64.0)
