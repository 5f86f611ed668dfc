"""The ground: lines are in their places and have their widths, near and far; there are none in the sky."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.vm_embedded.strategies import reals
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equidistant, Rectilinear
from vm_synth.render.ground import paint_ground
from vm_synth.render.turf import ground_noise
from vm_synth.scene.field import TURFS, FieldRanges, draw_field


def field(**changes):
    """A field of 9 x 6 m under the world's axes, of new paint."""
    made = draw_field(np.random.default_rng(0), FieldRanges())
    plain = {"length": 9.0, "width": 6.0, "line_width": 0.05, "border": 1.0, "middle": (0.0, 0.0), "heading": 0.0}
    return replace(made, **(plain | {"wear": 0.0, "stripe": 0.0, "turf": "felt"} | changes))


def from_above(low, high, step):
    """Centers (h, w, 2) of pixels of a size [m] between two corners (2,), as from straight above."""
    x, y = (np.arange(a + step / 2.0, b, step) for a, b in zip(low, high, strict=True))
    return np.stack(np.meshgrid(x, y), axis=-1)


def painted(its, points, step):
    """What a field looks like at places that are a step [m] apart."""
    return paint_ground(its, points, np.full(points.shape[:2], 10.0), step / 10.0)


def shares(its, low, high, step):
    """Shares (h, w) of lines seen from above."""
    return painted(its, from_above(low, high, step), step)[1].astype(np.float64)


CUTS = {
    "half line": ((-0.5, 1.0), (0.5, 2.0), 0.0),
    "left goal line": ((-5.0, -0.9), (-4.2, 0.9), -4.5),
    "right goal line": ((4.2, -0.9), (5.0, 0.9), 4.5),
    "goal area": ((3.2, -1.2), (3.9, 1.2), 3.5),
    "penalty area": ((2.1, -2.2), (2.9, -0.5), 2.5),
}
"""Corners of a stretch across which a line runs upwards, and its place."""


@pytest.mark.parametrize(("low", "high", "place"), CUTS.values(), ids=CUTS)
@pytest.mark.parametrize("step", [0.004, 0.01, 0.05, 0.07])
@pytest.mark.parametrize("width", [0.05, 0.12])
def test_a_cut_across_a_line_is_as_long_as_the_line_is_wide(low, high, place, step, width):
    its = field(line_width=width)
    x = from_above(low, high, step)[0, :, 0]
    share = shares(its, low, high, step)
    cuts = share.sum(axis=1) * step
    np.testing.assert_allclose(cuts, width, rtol=0.02)
    np.testing.assert_allclose((share @ x) * step / cuts, place, atol=0.02 * width + 0.5 * step)


def area_of_lines(its, step):
    """Square meters of line on the whole field."""
    half = np.array([its.length / 2.0 + 0.3, its.width / 2.0 + 0.3])
    return shares(its, -half, half, step).sum() * step * step


def test_the_area_of_lines_is_the_same_for_coarse_pixels():
    """For pixels up to twice as large as a line is wide; where lines meet, shares overlap a little."""
    its = field()
    fine = area_of_lines(its, 0.01)
    outline, half_line, circle = 2.0 * (9.0 + 6.0), 6.0, 2.0 * math.pi * 0.75
    areas = 2.0 * (3.0 + 2.0 * 1.0 + 5.0 + 2.0 * 2.0)
    assert fine == pytest.approx(0.05 * (outline + half_line + circle + areas) + 3 * math.pi * 0.05**2, rel=0.02)
    for step in (0.03, 0.05, 0.1):
        assert area_of_lines(its, step) == pytest.approx(fine, rel=0.04)


@pytest.mark.long
@given(reals(-math.pi, math.pi), reals(-2.0, 2.0), reals(-2.0, 2.0))
@settings(max_examples=15)
def test_a_field_is_turned_and_moved_as_a_whole(heading, x, y):
    moved = field(heading=heading, middle=(x, y))
    points = from_above((-5.0, -3.5), (5.0, 3.5), 0.03)
    there = points @ moved.rotation.T + (x, y)
    _, lines, carpet = painted(moved, there, 0.03)
    _, expected, under = painted(field(), points, 0.03)
    np.testing.assert_allclose(lines, expected, atol=1e-3)
    np.testing.assert_allclose(carpet, under, atol=1e-3)
    for spot in ((5.4, 3.9), (5.4, 4.1), (5.6, 0.0), (0.0, 0.0)):
        expected_inside = abs(spot[0]) < 5.5 and abs(spot[1]) < 4.0
        assert moved.on_carpet(moved.rotation @ spot + (x, y)) == expected_inside


def test_a_mirrored_field_is_the_same_field():
    share = shares(field(), (-5.0, -3.5), (5.0, 3.5), 0.02)
    np.testing.assert_allclose(share, share[::-1], atol=1e-4)
    np.testing.assert_allclose(share, share[:, ::-1], atol=1e-4)


def test_marks_and_circle_are_where_they_belong():
    its = field()
    spots = np.array([(0.0, 0.0), (3.0, 0.0), (-3.0, 0.0), (0.75, 0.0), (0.0, -0.75), (0.53, 0.53), (4.5, 3.0)])
    beside = np.array([(0.4, 0.2), (3.2, 0.0), (-3.0, 0.2), (0.85, 0.0), (1.0, 1.0), (4.8, 0.0), (0.2, 3.2)])
    for places, expected in ((spots, 1.0), (beside, 0.0)):
        for place in places:
            around = shares(its, place - 0.005, place + 0.005, 0.002)
            np.testing.assert_allclose(around, expected, atol=1e-6)


def test_the_carpet_ends_at_the_border():
    step = 0.02
    points = from_above((-6.0, -4.5), (6.0, 4.5), step)
    _, _, carpet = painted(field(border=0.7), points, step)
    assert carpet.sum() * step * step == pytest.approx((9.0 + 1.4) * (6.0 + 1.4), rel=5e-3)
    _, _, endless = painted(field(border=math.inf), points, step)
    np.testing.assert_array_equal(endless, 1.0)


SIZE = (160, 128)


def view(lens, pitch, roll=0.0, height=0.7, finer=1):
    """Places (h, w, 2) and distances (h, w) [m] that a camera's pixels see of the plane, and a pixel's angle [rad].

    finer: how many pixels there are in place of one, in each direction.
    """
    columns, rows = ((np.arange(finer * each) + 0.5) / finer - 0.5 for each in SIZE)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    rotation = Orientation.from_roll_pitch(height, roll, math.radians(pitch)).rotation
    rays = (lens.unproject(pixels, SIZE) @ rotation.T).reshape(len(rows), len(columns), 3)
    below = rays[..., 2] < -1e-4
    distance = np.where(below, height / np.where(below, -rays[..., 2], 1.0), np.inf)
    points = np.where(below[..., None], rays[..., :2] * np.where(below, distance, 0.0)[..., None], np.inf)
    return points, np.where(below, distance, 1e6), 1.0 / lens.focal_length / finer


LENSES = {
    "rectilinear": Rectilinear(focal_length=130.0, fov=2.4),
    "fisheye": Equidistant(focal_length=60.0, fov=3.1),
}


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize("pitch", [-10.0, 0.0, 7.0, 20.0, 40.0])
@pytest.mark.parametrize("roll", [0.0, 0.2])
def test_nothing_is_painted_in_the_sky_or_beyond_the_carpet(lens, pitch, roll):
    """Up to the pixels at the horizon, beyond which lies the sky; but for the border, where how large pixels are
    is known from one side only."""
    points, distance, pixel = view(lens, pitch, roll)
    its = field(middle=(1.0, 0.5), heading=0.3)
    albedo, lines, carpet = paint_ground(its, points, distance, pixel)
    away = np.abs((np.where(np.isfinite(points), points, 1e6) - its.middle) @ its.rotation)
    # What is so far out that no pixel there reaches the carpet; pixels in the sky are farther.
    outside = (away[..., 0] > 8.0) | (away[..., 1] > 6.5)
    outside[[0, -1]] = outside[:, [0, -1]] = False
    np.testing.assert_array_equal(lines[outside], 0.0)
    np.testing.assert_array_equal(carpet[outside], 0.0)
    inside = (away[..., 0] < 5.0) & (away[..., 1] < 3.5)
    assert inside.any()
    assert carpet[inside].min() > 0.5
    assert 0.01 <= albedo.min() <= albedo.max() <= 0.95
    assert np.isfinite(albedo).all()


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize("pitch", [0.0, 7.0, 20.0])
def test_endless_grass_ends_at_the_horizon(lens, pitch):
    points, distance, pixel = view(lens, pitch)
    _, lines, carpet = paint_ground(field(border=math.inf), points, distance, pixel)
    below = np.isfinite(points[..., 0])
    np.testing.assert_array_equal(carpet, below)
    np.testing.assert_array_equal(lines[~below], 0.0)
    # Lines are of the field: what lies far beyond it has none.
    np.testing.assert_array_equal(lines[below & (np.abs(points) > 12.0).any(axis=-1)], 0.0)


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize("pitch", [3.0, 25.0])
def test_a_coarse_picture_shows_what_a_fine_one_does(lens, pitch):
    """Far lines, thinner than a pixel, fade instead of being dotted."""
    its = field(middle=(2.0, 0.5), heading=0.2)
    _, coarse, carpet = paint_ground(its, *view(lens, pitch))
    _, fine, under = paint_ground(its, *view(lens, pitch, finer=6))
    for found, finely, most in ((coarse, fine, 0.05), (carpet, under, 0.01)):
        expected = finely.reshape(SIZE[1], 6, SIZE[0], 6).mean(axis=(1, 3))
        assert np.abs(found - expected).mean() < most * expected.mean() * 2.0
        assert found.sum() == pytest.approx(expected.sum(), rel=most)


looks = st.fixed_dictionaries(
    {
        "turf": st.sampled_from(TURFS),
        "texture": reals(0.0, 2.0),
        "stripe": st.sampled_from([0.0, 0.7]),
        "wear": reals(0.0, 1.0),
        "paint": reals(0.1, 1.0),
        "grass": st.tuples(reals(0.0, 0.95), reals(0.0, 0.95), reals(0.0, 0.95)),
        "border": st.sampled_from([0.0, 1.0, math.inf]),
        "seed": st.integers(0, 2**31 - 1),
    }
)


@pytest.mark.long
@given(looks, reals(-10.0, 60.0), reals(0.05, 3.0))
@settings(max_examples=20)
def test_all_looks_are_albedos_and_shares(changes, pitch, height):
    albedo, lines, carpet = paint_ground(field(**changes), *view(LENSES["fisheye"], pitch, height=height))
    assert albedo.shape == (SIZE[1], SIZE[0], 3)
    for each in (albedo, lines, carpet):
        assert each.dtype == np.float32
        assert np.isfinite(each).all()
        assert 0.0 <= each.min() <= each.max() <= 1.0


@given(looks)
@settings(max_examples=10)
def test_the_same_field_is_painted_the_same_each_time(changes):
    points = from_above((0.0, 0.0), (2.0, 1.0), 0.02)
    for first, second in zip(
        painted(field(**changes), points, 0.02), painted(field(**changes), points.copy(), 0.02), strict=True
    ):
        np.testing.assert_array_equal(first, second)


def test_other_seeds_are_other_ground():
    points = from_above((0.0, 0.0), (2.0, 1.0), 0.01)
    grounds = [painted(field(turf="natural", seed=seed), points, 0.01)[0] for seed in range(5)]
    for number, each in enumerate(grounds):
        assert all(np.abs(each - other).mean() > 1e-4 for other in grounds[:number])


@pytest.mark.parametrize("turf", TURFS)
@pytest.mark.parametrize("step", [0.001, 0.004, 0.016])
def test_the_texture_has_no_seam(turf, step):
    """Across the borders of its tiles it changes as much as anywhere: 1.024 m of grain, 6 m of patches."""
    its = field(turf=turf, seed=1, texture=0.5, grass=(0.3, 0.3, 0.3), line_width=1e-6, length=1e3, width=1e3)
    shift = np.random.default_rng(its.seed).uniform(0.0, 1.0, 2) * 6.0
    for border in (1.024, -2.048, 6.0 - shift[0], 12.0 - shift[0]):
        x = border + (np.arange(-64, 64) + 0.5) * step
        points = np.stack(np.meshgrid(x, 7.3 + np.arange(400) * step), axis=-1)
        for there in (points, points[..., ::-1].transpose(1, 0, 2) - (0.0, shift[0] - shift[1] if border > 3 else 0.0)):
            albedo = painted(its, there, step)[0].mean(axis=-1)
            axis = 1 if there is points else 0
            steps = np.abs(np.diff(albedo, axis=axis)).mean(axis=1 - axis)
            assert steps[63] <= 1.5 * np.quantile(steps, 0.95)


@pytest.mark.parametrize("turf", TURFS)
def test_grass_keeps_its_mean_color_from_any_distance(turf):
    its = field(turf=turf, texture=1.0, grass=(0.2, 0.3, 0.1), line_width=1e-6, length=1e3, width=1e3)
    for step, side in ((0.004, 1.024), (0.03, 6.0), (0.5, 60.0)):
        albedo = painted(its, from_above((0.0, 0.0), (side, side), step), step)[0]
        np.testing.assert_allclose(albedo.mean(axis=(0, 1)), its.grass, rtol=0.15)


def test_texture_fades_with_the_distance():
    deviations = []
    for step in (0.001, 0.01, 0.1, 1.0):
        points = from_above((0.0, 0.0), (100 * step, 100 * step), step)
        deviations.append(float(ground_noise(points, np.full(points.shape[:2], step), 3).std()))
    assert deviations[0] == pytest.approx(1.0, abs=0.35)
    assert deviations == sorted(deviations, reverse=True)
    assert deviations[-1] < 0.1


def test_ground_noise_is_one_number_a_pixel_and_the_same_for_the_same_seed():
    points, distance, pixel = view(LENSES["fisheye"], 10.0)
    noise = ground_noise(points, distance * pixel, 5)
    assert noise.shape == (SIZE[1], SIZE[0], 1)
    assert np.isfinite(noise).all()
    np.testing.assert_array_equal(noise, ground_noise(points, distance * pixel, 5))


def test_stripes_are_as_wide_as_drawn():
    its = field(texture=0.0, stripe=0.5, grass=(0.3, 0.3, 0.3), line_width=1e-6, length=1e3, width=1e3)
    step = 0.01
    albedo = painted(its, from_above((20.0, 20.0), (26.0, 20.1), step), step)[0].mean(axis=(0, 2))
    bright = albedo > albedo.mean()
    assert bright.mean() == pytest.approx(0.5, abs=0.02)
    assert np.diff(np.flatnonzero(np.diff(bright.astype(int)))) * step == pytest.approx(0.5, abs=0.011)


def test_paint_wears_off_by_the_configured_share():
    def worn(wear):
        """On average over fields."""
        low, high = (-0.3, -3.0), (0.3, 3.0)
        return np.mean(
            [
                1.0 - area / whole
                for area, whole in (
                    (
                        shares(field(seed=seed, wear=wear), low, high, 0.02).sum(),
                        shares(field(seed=seed), low, high, 0.02).sum(),
                    )
                    for seed in range(16)
                )
            ]
        )

    assert worn(0.0) == 0.0
    assert worn(0.5) == pytest.approx(0.5, abs=0.2)
    assert 0.0 < worn(0.2) < worn(0.5) < worn(0.8) < 1.0
