"""Footprints: near points take the mean of their surroundings, far ones their place."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.detection.footprint import BLOCK, Levels, footprint_widths, level_of, uniform_levels
from vm_embedded.detection.pixel_formats import checked_image
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.sampling import sample
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.models import build_mesh

spheres = st.builds(Sphere, st.floats(0.03, 0.12))


@given(spheres, st.floats(0.4, 2.0), st.floats(2.0, 6.0), st.floats(50.0, 3000.0))
def test_levels_follow_the_distance_between_rings(shape, height, intersections, scale):
    mesh = build_mesh(shape, height, intersections, 5.0)
    levels = Levels.of(level_of(footprint_widths(mesh.rays, shape, height, intersections, scale)))
    assert np.unique(levels.order).tolist() == list(range(len(mesh)))
    inclination = np.arccos(np.clip(-mesh.rays[:, 2], -1.0, 1.0))
    ring = shape.n(inclination, height) * intersections
    for level, share in levels.shares():
        points = np.unique(levels.order.reshape(-1, BLOCK)[share])
        chosen = points[ring[points] > 3.0 * intersections]  # nearer than that the small angles of the formula are none
        before, after = (shape.phi((ring[chosen] + side) / intersections, height) for side in (-0.5, 0.5))
        width = (after - before) * scale
        if len(chosen):
            assert width.min() > 0.85 * 2.0**level or level == 0
            assert width.max() < 1.15 * 2.0 ** (level + 1) or level == 7


def test_gaps_have_a_level_too():
    rays = np.array([[0.0, 0.0, -1.0], [np.nan] * 3])
    levels = Levels.of(level_of(footprint_widths(rays, Sphere(0.1), 1.0, 4.0, 400.0)))
    assert np.unique(levels.order).tolist() == [0, 1]


def test_points_that_are_alike_have_one_level():
    assert uniform_levels(5, 9.0).ends == (0, 0, 0, 1)
    assert uniform_levels(5, 0.3).ends == (1,)


@given(st.lists(st.integers(0, 7), max_size=300))
def test_each_point_is_in_whole_blocks_of_its_level(chosen):
    levels = Levels.of(np.array(chosen, dtype=np.int8))
    assert len(levels.order) == BLOCK * levels.ends[-1]
    found = {}
    for level, share in levels.shares():
        found |= dict.fromkeys(levels.order.reshape(-1, BLOCK)[share].reshape(-1).tolist(), level)
    assert found == dict(enumerate(chosen))


def colored(image, pixels, levels, format="bgr"):
    return sample(Pyramid(checked_image(image, format), format), pixels, levels).T


def all_from(level, pixels):
    return Levels.of(np.full(len(pixels), level))


places = st.lists(st.tuples(st.floats(40, 150), st.floats(40, 90)), min_size=1, max_size=20).map(np.array)


@given(places, st.integers(0, 4), st.sampled_from([(131, 197), (128, 192)]))
def test_a_slope_keeps_its_colors(pixels, level, size):
    rows, columns = np.mgrid[: size[0], : size[1]]
    image = np.stack([columns, rows, (rows + columns) // 2], axis=2).astype(np.uint8)
    error = colored(image, pixels, all_from(level, pixels)) - colored(image, pixels, all_from(0, pixels))
    assert np.abs(error).max() * 255 < 1.6


@given(places, st.integers(1, 4))
def test_a_fine_pattern_becomes_gray(pixels, level):
    rows, columns = np.mgrid[:128, :192]
    image = np.repeat((255 * ((rows + columns) % 2))[..., None], 3, axis=2).astype(np.uint8)
    assert colored(image, pixels, all_from(level, pixels)) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("format", ["gray", "bayer_rggb", "bgra"])
def test_every_format_has_levels(format):
    shape = {"gray": (64, 64), "bayer_rggb": (64, 64), "bgra": (64, 64, 4)}[format]
    image = np.full(shape, 100, dtype=np.uint8)
    pixels = np.array([[20.0, 30.0], [40.0, 50.0]])
    found = colored(image, pixels, Levels.of(np.array([0, 2])), format=format)
    assert found == pytest.approx(100 / 255, abs=0.01)


def test_a_picture_can_be_halved_to_nothing():
    image = np.full((3, 5, 3), 40, dtype=np.uint8)
    pixels = np.array([[1.0, 1.0], [4.0, 2.0]])
    assert colored(image, pixels, all_from(7, pixels)) == pytest.approx(40 / 255, abs=0.01)
