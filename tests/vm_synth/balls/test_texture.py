"""Textures of balls: every pattern is painted without seams, and textures differ."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vm_synth.balls.patterns import PATTERNS
from vm_synth.balls.texture import paint_texture

from .test_draw_design import designs

HEIGHT = 64


def of_kind(kind: str):
    return [replace(design, kind=kind) for design in designs(4, seed=len(kind))]


WHITE_ALBEDO, WHITE_CHROMA = 0.45, 0.25
"""What counts as white: the darkest channel is above the first, the channels differ by less than the second."""


def white_share(design, height: int = 64):
    """Share of the ball's area that is white, 0..1."""
    texture = paint_texture(design, height)
    low, high = texture.min(axis=2), texture.max(axis=2)
    white = (low > WHITE_ALBEDO) & (high - low < WHITE_CHROMA * high)
    weight = np.sin((np.arange(height) + 0.5) * math.pi / height)
    return float(white.mean(axis=1) @ weight / weight.sum())


@pytest.mark.parametrize("kind", PATTERNS)
def test_a_texture_is_linear_rgb_and_the_same_each_time(kind):
    for design in of_kind(kind):
        texture = paint_texture(design, HEIGHT)
        assert texture.shape == (HEIGHT, 2 * HEIGHT, 3)
        assert texture.dtype == np.float32
        assert texture.flags.c_contiguous
        assert texture.min() >= 0
        assert texture.max() <= 1
        np.testing.assert_array_equal(texture, paint_texture(design, HEIGHT))


@pytest.mark.parametrize("kind", PATTERNS)
def test_the_wrap_around_and_the_poles_do_not_show(kind):
    """At 256 rows, where noise is computed coarsely and enlarged."""
    for design in of_kind(kind):
        texture = paint_texture(replace(design, size=0.4), 256)
        steps = np.abs(np.diff(texture, axis=1, append=texture[:, :1])).mean(axis=(0, 2))
        # Some patterns have an edge of their own along this meridian.
        assert steps[-1] <= 1.3 * steps[:-1].max() + 1e-6
        across = np.abs(texture - np.roll(texture, 256, axis=1)).max(axis=2)
        largest = max(np.abs(np.diff(texture, axis=0)).max(), np.abs(np.diff(texture, axis=1)).max())
        assert across[[0, -1]].max() <= largest + 1e-6
        # The rows next to the poles are circles of a texel or two: they change slowly.
        assert np.abs(np.diff(texture[[0, -1]], axis=1)).max() < 0.15


@pytest.mark.long
def test_a_larger_texture_shows_the_same_ball():
    for kind in PATTERNS:
        design = of_kind(kind)[0]
        small = paint_texture(design, 256).reshape(64, 4, 128, 4, 3).mean(axis=(1, 3))
        large = paint_texture(design, 512).reshape(64, 8, 128, 8, 3).mean(axis=(1, 3))
        assert np.abs(small - large).mean() < 0.01, kind


def test_draws_are_all_different():
    textures = [paint_texture(design, 32).ravel() for design in designs(140)]
    for i, texture in enumerate(textures):
        assert all(np.abs(texture - other).mean() > 1e-3 for other in textures[:i])


@pytest.mark.long
def test_white_shares_span_all():
    shares = np.array([white_share(design, 32) for design in designs(400)])
    assert (shares < 0.05).mean() > 0.1
    assert (shares > 0.95).mean() > 0.03
    assert (shares > 0.5).mean() > 0.4
    assert ((shares > 0.05) & (shares < 0.95)).mean() > 0.3


def test_the_white_share_is_of_the_area():
    design = replace(designs(1)[0], base=(0.0, 0.0, 0.0), ink=(0.9, 0.9, 0.9), accent=(0.9, 0.9, 0.9))
    design = replace(design, kind="belt", twist=0.0, size=0.0, wear=0.0, marks=0, seam=0.0)
    # A band of |z| < 0.12 and a line around z = +-0.2: shares of the area are heights.
    assert white_share(design, 512) == pytest.approx(0.12 + 0.06, abs=0.01)
    assert white_share(replace(design, kind="plain", base=(0.8, 0.8, 0.8))) == pytest.approx(1.0)
    assert white_share(replace(design, kind="plain", base=(0.8, 0.3, 0.1))) == 0.0
