"""The share of pixels inside outlines, and overlaps of disks, against formulas."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.arrays import Floats
from vm_train.scores.object_scores import ObjectScores
from vm_train.scores.overlaps import TrueObject, coverage

SQUARE = np.array([(5.0, 5.0), (13.0, 5.0), (13.0, 13.0), (5.0, 13.0)]) - 0.5
"""Around 8 x 8 pixels."""


@dataclass(frozen=True, eq=False)
class FoundObject:
    confidence: float
    outline: Floats
    position: Floats
    bearing: Floats = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))


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


def disk_overlap(a, b, away):
    """Intersection over union of two disks of radii a and b whose centers are `away` apart."""
    if away >= a + b:
        return 0.0
    if away <= abs(a - b):
        return min(a, b) ** 2 / max(a, b) ** 2
    first = math.acos((away**2 + a**2 - b**2) / (2.0 * away * a))
    second = math.acos((away**2 + b**2 - a**2) / (2.0 * away * b))
    kite = math.sqrt((a + b - away) * (away + a - b) * (away + b - a) * (away + a + b)) / 2.0
    common = a**2 * first + b**2 * second - kite
    return common / (math.pi * (a**2 + b**2) - common)


def shown(outline, size, kind):
    """A mask (h, w) of what the outline covers, by pixel centers or by shares."""
    mask = np.zeros(size[::-1])
    window, share = coverage(outline, size)
    mask[window] = share
    return mask >= 0.5 if kind is bool else mask.astype(kind)


@given(
    st.floats(10.0, 60.0), st.floats(0.7, 1.4), st.floats(0.0, 2.2), st.floats(0.0, 6.3), st.sampled_from([bool, float])
)
def test_overlaps_of_disks_are_those_of_the_formula(radius, ratio, away, turn, kind):
    size = (400, 400)
    other = max(radius * ratio, 10.0)
    away *= radius
    x, y = 200.3 + away * math.cos(turn), 199.6 + away * math.sin(turn)
    truth = TrueObject(shown(circle(200.3, 199.6, radius), size, kind), np.zeros(3), radius)
    # Found at thresholds below the true overlap and not above it.
    expected = disk_overlap(radius, other, away)
    below, above = expected - 0.02, expected + 0.02
    scores = ObjectScores(overlaps=[each for each in (below, above) if 0.0 < each <= 1.0] or [1.0])
    scores.add([truth], [FoundObject(1.0, circle(x, y, other), np.zeros(3))])
    if below > 0.0:
        assert scores.ranking(below).at().hits == 1
    if above <= 1.0:
        assert scores.ranking(above).at().hits == 0
