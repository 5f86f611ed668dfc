"""Fields are drawn within their ranges, with the camera on them."""

import math

import numpy as np
import pytest
from hypothesis import given

from tests.vm_embedded.strategies import seeds
from vm_synth.scene.field import TURFS, FieldRanges, draw_field


@given(seeds)
def test_drawn_fields_stay_in_their_ranges(seed):
    ranges = FieldRanges(endless=0.0, odd_colors=0.0)
    its = draw_field(np.random.default_rng(seed), ranges)
    for name in ("length", "line_width", "border", "texture", "paint"):
        low, high = getattr(ranges, name)
        assert low <= getattr(its, name) <= high
    assert ranges.proportion[0] - 1e-9 <= its.width / its.length <= ranges.proportion[1] + 1e-9
    assert its.turf in TURFS
    assert 0.0 <= its.wear <= ranges.wear[1]
    assert its.grass[1] == max(its.grass) or ranges.hue[1] > 180.0
    assert 0.0 <= min(its.grass) <= max(its.grass) <= 0.95
    assert float(np.dot(its.grass, (0.21, 0.72, 0.07))) <= ranges.albedo[1] + 1e-9


@given(seeds)
def test_the_camera_stands_on_the_field(seed):
    """It is over the world's origin."""
    assert draw_field(np.random.default_rng(seed), FieldRanges(border=(0.0, 0.0))).on_carpet(np.zeros(2))


def test_shares_of_fields_are_as_configured():
    random = np.random.default_rng(0)
    drawn = [draw_field(random, FieldRanges(endless=0.25, stripes=0.2, turfs=("felt", "natural"))) for _ in range(1500)]
    assert np.mean([math.isinf(each.border) for each in drawn]) == pytest.approx(0.25, abs=0.05)
    assert np.mean([each.stripe > 0.0 for each in drawn]) == pytest.approx(0.2, abs=0.05)
    assert {each.turf for each in drawn} == {"felt", "natural"}


@given(seeds)
def test_the_same_chance_draws_the_same_field(seed):
    first, second = (draw_field(np.random.default_rng(seed), FieldRanges()) for _ in range(2))
    assert first == second
