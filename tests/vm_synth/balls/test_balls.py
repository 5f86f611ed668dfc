"""Ball designs: drawn by chance, painted alike each time, without seams at the wrap-around or at the poles."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_synth.balls.balls import BallRanges, draw_design, paint, white_share
from vm_synth.balls.design import BallDesign
from vm_synth.balls.patterns import KINDS

HEIGHT = 64


def designs(count: int, seed: int = 0, ranges: BallRanges | None = None) -> list[BallDesign]:
    random = np.random.default_rng(seed)
    return [draw_design(random, ranges or BallRanges()) for _ in range(count)]


def of_kind(kind: str) -> list[BallDesign]:
    return [replace(design, kind=kind) for design in designs(4, seed=len(kind))]


@pytest.mark.parametrize("kind", KINDS)
def test_a_texture_is_linear_rgb_and_the_same_each_time(kind):
    for design in of_kind(kind):
        texture = paint(design, HEIGHT)
        assert texture.shape == (HEIGHT, 2 * HEIGHT, 3)
        assert texture.dtype == np.float32
        assert texture.flags.c_contiguous
        assert texture.min() >= 0
        assert texture.max() <= 1
        np.testing.assert_array_equal(texture, paint(design, HEIGHT))


@pytest.mark.parametrize("kind", KINDS)
def test_the_wrap_around_and_the_poles_do_not_show(kind):
    """At 256 rows, where noise is computed coarsely and enlarged."""
    for design in of_kind(kind):
        texture = paint(replace(design, size=0.4), 256)
        steps = np.abs(np.diff(texture, axis=1, append=texture[:, :1])).mean(axis=(0, 2))
        # Some patterns have an edge of their own along this meridian.
        assert steps[-1] <= 1.3 * steps[:-1].max() + 1e-6
        across = np.abs(texture - np.roll(texture, 256, axis=1)).max(axis=2)
        largest = max(np.abs(np.diff(texture, axis=0)).max(), np.abs(np.diff(texture, axis=1)).max())
        assert across[[0, -1]].max() <= largest + 1e-6
        # The rows next to the poles are circles of a texel or two: they change slowly.
        assert np.abs(np.diff(texture[[0, -1]], axis=1)).max() < 0.15


def test_a_larger_texture_shows_the_same_ball():
    for kind in KINDS:
        design = of_kind(kind)[0]
        small = paint(design, 256).reshape(64, 4, 128, 4, 3).mean(axis=(1, 3))
        large = paint(design, 512).reshape(64, 8, 128, 8, 3).mean(axis=(1, 3))
        assert np.abs(small - large).mean() < 0.01, kind


def test_draws_are_all_different():
    textures = [paint(design, 32).ravel() for design in designs(140)]
    for i, texture in enumerate(textures):
        assert all(np.abs(texture - other).mean() > 1e-3 for other in textures[:i])


def test_draws_are_the_same_for_the_same_chance():
    assert designs(20, seed=5) == designs(20, seed=5)
    assert designs(20, seed=5) != designs(20, seed=6)


def test_every_kind_occurs():
    assert {design.kind for design in designs(1500)} == set(KINDS)
    assert {design.kind for design in designs(30, ranges=BallRanges(kinds=("dots", "plain")))} == {"dots", "plain"}


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


def test_shares_of_nought_and_one_hold():
    no_white = designs(50, ranges=BallRanges(white=0.0, dark=1.0, bright=0.0, worn=0.0, marked=0.0))
    assert all(max(design.base) < 0.06 and design.wear == 0 and design.marks == 0 for design in no_white)
    bright = designs(50, ranges=BallRanges(bright=1.0))
    assert all(min(*design.base, *design.ink, *design.accent) > 0.8 for design in bright)


def test_the_surface_stays_in_its_ranges():
    for design in designs(200, ranges=BallRanges(roughness=(0.05, 1.0))):
        assert 0.05 <= design.roughness <= 1
        assert 0 <= design.specular <= 1
        assert 0 <= design.clearcoat <= 1
    assert all(0.3 <= design.roughness <= 0.4 for design in designs(50, ranges=BallRanges(roughness=(0.3, 0.4))))


def test_a_design_goes_through_json():
    for design in designs(20):
        back = json.loads(json.dumps(asdict(design)))
        back = BallDesign(**{name: tuple(each) if isinstance(each, list) else each for name, each in back.items()})
        assert back == design


@pytest.mark.parametrize(
    ("entry", "value", "said"),
    [
        ("kinds", ["clasic"], "did you mean 'classic'"),
        ("kinds", [], "kinds must be a list"),
        ("white", 1.2, "white must be a number from 0 to 1"),
        ("roughness", [0.0, 0.5], "roughness must be a number from 0.05 to 1"),
        ("wear", [0.5, 0.1], "wear must be"),
    ],
)
def test_a_bad_entry_is_named(entry, value, said):
    with pytest.raises(InputError, match=said):
        BallRanges(**{entry: value})
