"""Drawn cameras: the picture shows the angle that was drawn, and heights and attitudes stay in their ranges."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.vm_embedded.strategies import rays_at, reals, seeds
from vm_embedded.geometry.radial_lenses import PROJECTIONS, Equisolid, Rectilinear
from vm_synth.scene.camera import CameraRanges, draw_lens, draw_orientation

STRAIGHT = CameraRanges(off_center=(0.0, 0.0), distorted=0.0, image_circle=0.0)
"""Lenses without distortion whose axis is the picture's center."""

sizes = st.tuples(st.integers(64, 1500), st.integers(64, 1500))


def lens_of(seed, ranges):
    return draw_lens(np.random.default_rng(seed), ranges)


def orientations(ranges, count):
    random = np.random.default_rng(0)
    return [draw_orientation(random, ranges) for _ in range(count)]


def edges(lens, size):
    """Rays (2, 3) through the middles of the left and the right edge."""
    width, height = size
    return lens.unproject(np.array([[0.0, height / 2.0], [width, height / 2.0]]), size)


@pytest.mark.parametrize("name", PROJECTIONS)
@given(sizes, reals(5.0, 150.0), seeds)
def test_from_edge_to_edge_is_the_drawn_angle(name, size, view, seed):
    ranges = replace(
        STRAIGHT,
        picture_width=size[0],
        picture_height=size[1],
        projections=(name,),
        rectilinear_view=(view, view),
        fisheye_view=(view, view),
    )
    lens = lens_of(seed, ranges)
    assert type(lens) is PROJECTIONS[name]
    left, right = edges(lens, ranges.size)
    assert math.degrees(math.acos(np.clip(left @ right, -1.0, 1.0))) == pytest.approx(view, abs=1e-5)
    assert left[1] > 0 > right[1]


@given(reals(150.0, 300.0), seeds)
def test_a_fisheye_sees_more_than_half_a_turn(view, seed):
    ranges = replace(STRAIGHT, projections=("equisolid", "equidistant"), fisheye_view=(view, view))
    lens = lens_of(seed, ranges)
    left, right = edges(lens, ranges.size)
    angles = [math.degrees(math.acos(ray[0])) for ray in (left, right)]
    assert angles == pytest.approx([view / 2.0, view / 2.0], abs=1e-5)


@given(seeds)
def test_a_drawn_view_is_in_its_range(seed):
    lens = lens_of(seed, STRAIGHT)
    left, _ = edges(lens, STRAIGHT.size)
    view = 2.0 * math.degrees(math.acos(left[0]))
    low, high = STRAIGHT.rectilinear_view if isinstance(lens, Rectilinear) else STRAIGHT.fisheye_view
    assert low - 1e-6 <= view <= high + 1e-6


@given(seeds)
def test_a_lens_reaches_the_corners_unless_it_has_an_image_circle(seed):
    """With a center off the middle, too; strong distortion may leave some corners black."""
    ranges = CameraRanges(image_circle=0.0, distorted=0.0)
    lens = lens_of(seed, ranges)
    width, height = ranges.size
    corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]])
    rays = lens.unproject(corners, ranges.size)
    assert lens.sees(rays).all()


@given(st.sampled_from(["equisolid", "equidistant"]), reals(0.2, 1.5), reals(80.0, 200.0), seeds)
def test_an_image_circle_has_the_drawn_diameter(name, diameter, view, seed):
    """A circle that fits into the picture shows what was drawn; a larger one is cut by the edges, as without it."""
    ranges = replace(
        STRAIGHT, image_circle=1.0, circle=(diameter, diameter), projections=(name,), fisheye_view=(view, view)
    )
    lens = lens_of(seed, ranges)
    rim = lens.project(rays_at(np.full(8, lens.limit), np.arange(8.0)), ranges.size)
    radius = np.linalg.norm(rim - np.array(ranges.size) / 2.0, axis=1)
    whole = lens.limit > math.radians(179.9)
    assert whole or radius == pytest.approx(0.5 * diameter * ranges.picture_width, rel=1e-6)
    if diameter <= 1.0:
        assert lens.limit == pytest.approx(math.radians(view / 2.0), rel=1e-9)
    else:
        left, _ = edges(lens, ranges.size)
        assert math.acos(left[0]) == pytest.approx(math.radians(view / 2.0), rel=1e-9)


@given(reals(80.0, 300.0), reals(0.1, 2.0), seeds)
def test_every_allowed_circle_is_a_lens(view, diameter, seed):
    ranges = CameraRanges(image_circle=1.0, circle=(diameter, diameter), fisheye_view=(view, view))
    assert 0.0 < lens_of(seed, ranges).limit <= math.pi


@given(reals(0.0, 1.0), seeds)
def test_center_and_distortion_stay_in_their_ranges(circles, seed):
    ranges = CameraRanges(image_circle=circles, distorted=1.0, off_center=(0.01, 0.03), distortion=(-0.03, -0.02))
    lens = lens_of(seed, ranges)
    assert all(0.01 * ranges.picture_width <= each <= 0.03 * ranges.picture_width for each in lens.center)
    assert -0.03 - 1e-12 <= lens.distortion[0] * lens.focal_length**2 <= -0.02 + 1e-12
    assert lens.distortion[1] == 0.0


def test_shares_of_lenses_are_as_configured():
    random = np.random.default_rng(1)
    lenses = [draw_lens(random, CameraRanges()) for _ in range(1500)]
    assert np.mean([each.distortion[0] != 0.0 for each in lenses]) == pytest.approx(0.5, abs=0.05)
    for kind in PROJECTIONS.values():
        assert np.mean([type(each) is kind for each in lenses]) == pytest.approx(1 / 3, abs=0.05)
    assert {type(draw_lens(random, CameraRanges(projections=("equisolid",)))) for _ in range(9)} == {Equisolid}


def test_the_picture_s_size_is_width_and_height():
    assert CameraRanges(picture_width=320, picture_height=200).size == (320, 200)


@given(seeds)
def test_heights_and_attitudes_stay_in_their_ranges(seed):
    ranges = CameraRanges(steep=0.0, tumbled=0.0, height=(0.4, 0.5), pitch=(10.0, 20.0), roll=(-8.0, 3.0))
    found = draw_orientation(np.random.default_rng(seed), ranges)
    assert 0.4 <= found.height <= 0.5
    assert 10.0 - 1e-9 <= math.degrees(found.pitch) <= 20.0 + 1e-9
    assert -8.0 - 1e-9 <= math.degrees(found.roll) <= 3.0 + 1e-9


def test_shares_of_attitudes_are_as_configured():
    ranges = CameraRanges(steep=0.3, pitch=(0.0, 30.0), steep_pitch=(50.0, 80.0), tumbled=0.2, roll=(-1.0, 1.0))
    drawn = orientations(ranges, 2000)
    steep = [math.degrees(each.pitch) > 40.0 for each in drawn]
    tumbled = [abs(math.degrees(each.roll)) > 1.0 + 1e-9 for each in drawn]
    assert np.mean(steep) == pytest.approx(0.3, abs=0.04)
    assert np.mean(tumbled) == pytest.approx(0.2 * 178.0 / 180.0, abs=0.04)


def test_headings_go_all_around():
    turns = np.array([each.yaw for each in orientations(CameraRanges(steep=0.0), 2000)])
    counts, _ = np.histogram(turns, bins=8, range=(-np.pi, np.pi))
    assert counts.min() > 180


@given(seeds)
def test_the_same_chance_gives_the_same_camera(seed):
    ranges = CameraRanges()
    assert lens_of(seed, ranges) == lens_of(seed, ranges)
    first, second = (draw_orientation(np.random.default_rng(seed), ranges) for _ in range(2))
    assert first.height == second.height
    np.testing.assert_array_equal(first.rotation, second.rotation)
