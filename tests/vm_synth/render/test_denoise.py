"""Smoothing of traced light: grain goes, edges and the amount of light stay."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.vm_embedded.strategies import reals, seeds
from vm_synth.render.denoise import denoise

SHAPE = (40, 48)
INNER = (slice(8, -8), slice(8, -8))
"""Away from the border, where neighbors are copies of the edge."""


def plain(values):
    """An array (h, w, 3) of one color."""
    return np.broadcast_to(np.float32(values), (*SHAPE, 3)).copy()


def flat(light, albedo=0.5, normal=(0.0, 0.0, 1.0), depth=2.0, share=1.0):
    """All arguments of `denoise` for a flat patch; each a number, a color or an array."""
    return (
        np.asarray(light, dtype=np.float32),
        plain(albedo) if np.size(albedo) <= 3 else np.asarray(albedo, dtype=np.float32),
        plain(normal) if np.size(normal) <= 3 else np.asarray(normal, dtype=np.float32),
        np.broadcast_to(np.float32(depth), SHAPE).copy(),
        np.broadcast_to(np.float32(share), SHAPE).copy(),
    )


def grainy(seed, mean=1.0, deviation=0.3):
    random = np.random.default_rng(seed)
    return np.clip(random.normal(mean, deviation, (*SHAPE, 3)), 0.0, None).astype(np.float32)


@given(st.tuples(reals(0.0, 50.0), reals(0.0, 50.0), reals(0.0, 50.0)), reals(0.0, 1.0), reals(1e-3, 200.0), seeds)
def test_even_light_stays_whatever_the_shape(color, albedo, depth, seed):
    random = np.random.default_rng(seed)
    normal = random.normal(size=(*SHAPE, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    distance = depth * random.uniform(1.0, 5.0, SHAPE)
    share = random.uniform(0.0, 1.0, SHAPE)
    share[::5, ::5] = 1e-7  # such a pixel keeps its light if no neighbor is like it
    light = plain(color)
    np.testing.assert_allclose(denoise(*flat(light, albedo, normal, distance, share)), light, rtol=1e-4, atol=1e-6)


@given(seeds)
def test_a_pattern_of_the_surface_under_even_light_stays(seed):
    """Albedo is no grain: light that falls evenly shows it as it is."""
    albedo = np.random.default_rng(seed).uniform(0.0, 0.9, (*SHAPE, 3)).astype(np.float32)
    light = 2.0 * (albedo + np.float32(0.03))
    np.testing.assert_allclose(denoise(*flat(light, albedo)), light, rtol=1e-4)


@given(seeds, reals(0.01, 100.0))
def test_grain_shrinks_and_the_light_of_a_flat_patch_stays(seed, brightness):
    light = brightness * grainy(seed)
    found = denoise(*flat(light))
    assert found.shape == light.shape
    assert found.dtype == np.float32
    assert found[INNER].var() <= light[INNER].var() / 20.0
    assert found.mean() == pytest.approx(light.mean(), rel=0.01)


def halves(left, right):
    """(h, w, ...) of one value left of the middle and another right of it."""
    value = np.empty((*SHAPE, *np.shape(left)), dtype=np.float32)
    value[:, : SHAPE[1] // 2] = left
    value[:, SHAPE[1] // 2 :] = right
    return value


BORDERS = {
    "a corner": {"normal": halves((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))},
    "a blunt corner": {"normal": halves((0.0, 0.0, 1.0), (0.0, 0.8, 0.6))},
    "a nearer thing": {"depth": halves(1.0, 2.0)},
    "a little nearer thing": {"depth": halves(1.0, 1.15)},
}


@pytest.mark.parametrize("border", BORDERS.values(), ids=BORDERS)
def test_light_does_not_cross(border):
    light = halves((1.0, 1.0, 1.0), (5.0, 4.0, 3.0))
    np.testing.assert_allclose(denoise(*flat(light, **border)), light, rtol=0.02)


@pytest.mark.parametrize("border", BORDERS.values(), ids=BORDERS)
@given(seeds)
def test_grain_shrinks_on_both_sides(border, seed):
    light = grainy(seed)
    found = denoise(*flat(light, **border))
    for side in (slice(0, SHAPE[1] // 2), slice(SHAPE[1] // 2, None)):
        assert found[:, side].var() <= light[:, side].var() / 5.0
        assert found[:, side].mean() == pytest.approx(light[:, side].mean(), rel=0.02)


def test_without_a_border_light_is_spread():
    """So that the tests above are no accident."""
    light = halves((1.0, 1.0, 1.0), (5.0, 4.0, 3.0))
    found = denoise(*flat(light))
    assert found[20, SHAPE[1] // 2 - 1, 0] > 1.3


@given(seeds)
def test_where_nothing_is_covered_nothing_changes(seed):
    random = np.random.default_rng(seed)
    share = random.uniform(0.0, 1.0, SHAPE) * (random.random(SHAPE) < 0.5)
    light = grainy(seed)
    found = denoise(*flat(light, share=share))
    np.testing.assert_array_equal(found[share == 0.0], light[share == 0.0])
    assert not np.array_equal(found[share > 0.0], light[share > 0.0])


@given(seeds)
def test_what_is_not_covered_does_not_shine_on_the_rest(seed):
    share = halves(1.0, 0.0)
    light = grainy(seed)
    other = np.where(share[..., None] > 0.0, light, 1000.0).astype(np.float32)
    covered = share > 0.0
    np.testing.assert_array_equal(
        denoise(*flat(light, share=share))[covered], denoise(*flat(other, share=share))[covered]
    )


def test_what_goes_in_is_left_as_it_is():
    arguments = flat(grainy(0), share=0.5)
    before = [each.copy() for each in arguments]
    denoise(*arguments)
    for each, was in zip(arguments, before, strict=True):
        np.testing.assert_array_equal(each, was)


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (3, 2)])
def test_pictures_smaller_than_the_reach_are_smoothed(size):
    light = np.random.default_rng(0).random((*size, 3)).astype(np.float32)
    ones = np.ones(size, dtype=np.float32)
    found = denoise(light, np.ones_like(light), np.ones_like(light), ones, ones)
    assert light.min() <= found.min() <= found.max() <= light.max()
