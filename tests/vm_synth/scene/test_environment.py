"""Environment maps: where a direction is in them, how much light falls from them, and which files are refused."""

import math
import os
import re

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.vm_embedded.strategies import reals
from vm_embedded.errors import InputError
from vm_synth.scene.environment import Environment
from vm_synth.scene.maps import MapRanges

SIZE = (256, 128)
"""Columns and rows of the maps of these tests."""


def directions(size=SIZE):
    """Unit vectors (h, w, 3) to the centers of a map's texels: row 0 at the zenith, azimuth growing to the left."""
    columns, rows = size
    polar = (np.arange(rows)[:, None] + 0.5) / rows * np.pi
    azimuth = 2.0 * np.pi * (0.5 - (np.arange(columns)[None] + 0.5) / columns)
    return np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0.0 * azimuth], axis=-1
    )


def solid_angles(size=SIZE):
    """Solid angle (h, 1, 1) [sr] of the texels of each row."""
    columns, rows = size
    ends = np.cos(np.arange(rows + 1) / rows * np.pi)
    return ((ends[:-1] - ends[1:]) * 2.0 * np.pi / columns)[:, None, None]


def toward(azimuth, elevation):
    return np.array(
        [
            math.cos(elevation) * math.cos(azimuth),
            math.cos(elevation) * math.sin(azimuth),
            math.sin(elevation),
        ]
    )


def environment(radiance, floor=None):
    return Environment("made", np.asarray(radiance, dtype=np.float32), floor)


def constant(*color, size=SIZE):
    return np.ones((size[1], size[0], 3)) * color


def spot(middle, width=0.05, size=SIZE):
    """A bright spot in a direction (3,) on a dim sky, of a different strength in each color."""
    bright = np.exp((directions(size) @ middle - 1.0) / width**2)
    return 0.05 + bright[..., None] * (3.0, 2.0, 1.0)


def with_sun(middle, strength, angle=0.02, size=SIZE):
    """A gray sky with a disk of light of this angular radius [rad]."""
    inside = directions(size) @ middle > math.cos(angle)
    return np.where(inside[..., None], np.multiply(strength, (1.0, 0.9, 0.7)), (0.2, 0.3, 0.4))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("maps")


def written(folder, radiance, name="made.hdr"):
    path = folder / name
    assert cv2.imwrite(str(path), np.ascontiguousarray(radiance[..., ::-1], dtype=np.float32))
    return path


anywhere = st.tuples(reals(-math.pi, math.pi), reals(-math.pi / 2.0, math.pi / 2.0))
AT_THE_SEAMS = [
    *((math.pi, 0.4), (-math.pi, 0.4), (math.pi - 0.005, -0.2), (-math.pi + 0.005, -0.2)),
    *((0.3, math.pi / 2.0), (2.0, math.pi / 2.0 - 0.01), (-2.0, 0.01 - math.pi / 2.0)),
]


@pytest.mark.parametrize(("azimuth", "elevation"), [*AT_THE_SEAMS, (0.0, 0.0), (math.pi / 2.0, 0.5), (-2.0, -0.9)])
@pytest.mark.parametrize("suffix", [".hdr", ".pfm"])
def test_a_spot_of_a_file_is_seen_where_it_was_put(folder, azimuth, elevation, suffix):
    middle = toward(azimuth, elevation)
    path = written(folder, spot(middle), f"spot{suffix}")
    found = Environment.read(path, MapRanges()).radiance_along(middle[None, None])[0, 0]
    np.testing.assert_allclose(found, (3.05, 2.05, 1.05), rtol=0.1)


@given(anywhere)
def test_the_brightest_ray_points_at_the_spot(place):
    """Among rays around the spot, across the wrap-around and over the poles."""
    middle = toward(*place)
    made = environment(spot(middle))
    rays = middle + 0.06 * np.random.default_rng(0).normal(size=(40, 40, 3))
    rays[0, 0] = middle
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    light = made.radiance_along(rays)
    expected = 0.05 + np.exp((rays @ middle - 1.0) / 0.05**2)[..., None] * (3.0, 2.0, 1.0)
    assert np.abs(light - expected).max() < 0.4
    assert np.abs(light - expected).mean() < 0.05
    brightest = rays.reshape(-1, 3)[light.sum(axis=-1).argmax()]
    assert math.acos(min(float(brightest @ middle), 1.0)) < math.radians(1.5)


def test_each_texel_is_seen_at_its_center():
    radiance = np.random.default_rng(0).random((SIZE[1], SIZE[0], 3))
    np.testing.assert_allclose(environment(radiance).radiance_along(directions()), radiance, atol=0.07)
    assert np.abs(environment(radiance).radiance_along(directions()) - radiance).mean() < 0.01


@given(reals(-1.5, 1.5))
def test_nothing_jumps_at_the_wrap_around(elevation):
    made = environment(spot(toward(math.pi - 0.02, elevation)))
    left, right = (toward(turn, elevation) for turn in (math.pi - 1e-6, -math.pi + 1e-6))
    first, second = made.radiance_along(np.stack([left, right])[None])[0]
    np.testing.assert_allclose(first, second, rtol=1e-3)


@given(st.tuples(reals(0.01, 100.0), reals(0.01, 100.0), reals(0.01, 100.0)))
@settings(max_examples=10)
def test_a_constant_sky_throws_pi_times_its_radiance_on_the_plane(color):
    made = environment(constant(*color))
    np.testing.assert_allclose(made.irradiance, np.multiply(np.pi, color), rtol=5e-3)
    np.testing.assert_allclose(made.floor_albedo, 0.9, rtol=1e-6)


@pytest.mark.parametrize("power", [1, 2, 5])
def test_the_light_of_a_lobe_around_the_zenith_is_its_integral(power):
    """Of cos^n: 2 pi / (n + 2)."""
    up = np.maximum(directions()[..., 2], 0.0) ** power
    made = environment(up[..., None] * (1.0, 2.0, 3.0))
    np.testing.assert_allclose(made.irradiance, 2.0 * np.pi / (power + 2) * np.array([1, 2, 3]), rtol=5e-3)


@given(reals(-math.pi, math.pi), reals(math.radians(12.0), math.pi / 2.0))
@settings(max_examples=20)
def test_the_light_of_a_small_spot_falls_by_the_cosine(azimuth, elevation):
    middle = toward(azimuth, elevation)
    radiance = spot(middle) - 0.05
    size = solid_angles()
    total = (radiance * size).sum(axis=(0, 1))
    mean = (radiance * size * directions()[..., 2:]).sum(axis=(0, 1)) / total
    np.testing.assert_allclose(mean, math.sin(elevation), atol=0.02)
    np.testing.assert_allclose(environment(radiance).irradiance, total * mean, rtol=5e-3)


def test_what_is_below_the_horizon_does_not_light_the_plane():
    dark = constant(1.0, 1.0, 1.0) * (directions()[..., 2:] < 0)
    np.testing.assert_allclose(environment(dark + 1e-6).irradiance, 0.0, atol=1e-4)


@given(st.tuples(reals(0.05, 0.85), reals(0.05, 0.85), reals(0.05, 0.85)), reals(0.1, 50.0))
@settings(max_examples=10)
def test_the_ground_s_albedo_is_that_of_an_evenly_lit_floor(albedo, light):
    radiance = constant(light, light, light)
    below = directions()[..., 2:] < 0
    made = environment(np.where(below, light * np.array(albedo), radiance))
    np.testing.assert_allclose(made.floor_albedo, albedo, rtol=1e-2)


def total_light(radiance):
    """Radiance of a map times its solid angle, over all directions (3,)."""
    return (radiance * solid_angles((radiance.shape[1], radiance.shape[0]))).sum(axis=(0, 1), dtype=np.float64)


@pytest.mark.parametrize("size", [(256, 128), (1024, 512), (512, 256)])
@given(reals(-math.pi, math.pi), reals(math.radians(5.0), math.pi / 2.0), reals(1.0, 20000.0))
@example(0.0, 1.5703125, 59.0)
@example(0.0, math.pi / 2.0, 20000.0)
@settings(max_examples=8)
def test_taking_the_sun_out_keeps_all_light(size, azimuth, elevation, strength):
    """Its irradiance and the rest of the sky: a surface that faces it gets the light of the resized map."""
    whole = with_sun(toward(azimuth, elevation), strength, angle=0.035, size=size).astype(np.float32)
    resized = whole if size == SIZE else cv2.resize(whole, SIZE, interpolation=cv2.INTER_AREA)
    lighting = environment(whole).lighting(SIZE)
    np.testing.assert_allclose(total_light(lighting.sky) + lighting.sun, total_light(resized), rtol=1e-4)
    assert lighting.sky.shape == (SIZE[1], SIZE[0], 3)
    assert lighting.sky.min() >= 0.0


@pytest.mark.parametrize("size", [(1024, 512), (512, 256)])
@given(reals(-math.pi, math.pi), reals(math.radians(5.0), math.radians(85.0)), reals(1.0, 20000.0))
@settings(max_examples=8)
def test_resizing_keeps_the_light_of_a_sun_below_the_zenith(size, azimuth, elevation, strength):
    """At the zenith up to 11 % is lost or gained: a map's rows there count alike, but differ in solid angle."""
    whole = with_sun(toward(azimuth, elevation), strength, angle=0.035, size=size)
    lighting = environment(whole).lighting(SIZE)
    np.testing.assert_allclose(total_light(lighting.sky) + lighting.sun, total_light(whole), rtol=1e-2)


@given(reals(-math.pi, math.pi), reals(math.radians(5.0), math.pi / 2.0))
@settings(max_examples=20)
def test_the_sun_is_found_where_it_is(azimuth, elevation):
    """Within half a degree, from a map of a texel of 0.35 degrees, wherever it stands."""
    size = (1024, 512)
    middle = toward(azimuth, elevation)
    lighting = environment(with_sun(middle, 5000.0, size=size)).lighting(size)
    assert np.linalg.norm(lighting.toward_sun) == pytest.approx(1.0, abs=1e-9)
    assert math.degrees(math.acos(min(float(lighting.toward_sun @ middle), 1.0))) < 0.5
    assert lighting.sky.max() < 61 * 0.4
    np.testing.assert_allclose(lighting.sun / lighting.sun[0], (1.0, 0.9, 0.7), atol=0.005)


def test_a_sky_without_a_sun_stays_as_it_is():
    radiance = constant(1.0, 2.0, 3.0) * (1.0 + np.random.default_rng(0).random((SIZE[1], SIZE[0], 1)))
    lighting = environment(radiance).lighting(SIZE)
    np.testing.assert_array_equal(lighting.sky, radiance.astype(np.float32))
    np.testing.assert_array_equal(lighting.sun, 0.0)
    assert np.linalg.norm(lighting.toward_sun) == pytest.approx(1.0)


def test_a_lamp_below_the_horizon_is_no_sun():
    lighting = environment(with_sun(toward(0.5, -0.5), 5000.0)).lighting(SIZE)
    np.testing.assert_array_equal(lighting.sun, 0.0)


def test_what_is_known_of_a_map_goes_by_its_name(folder):
    path = written(folder, constant(1.0, 1.0, 1.0), "hall_1k.hdr")
    found = Environment.read(path, MapRanges(floors={"hall_1k": 30.0, "other": 5.0}))
    assert found.name == "hall_1k"
    assert found.floor == pytest.approx(math.pi / 6.0)
    assert Environment.read(path, MapRanges(floors={"hall": 30.0})).floor is None


def noisy(size=SIZE):
    return 0.1 + np.random.default_rng(0).random((size[1], size[0], 3))


def damaged(folder, kind):
    """A file that is no map, of one of the kinds of DAMAGE."""
    whole = written(folder, noisy(), "whole.hdr").read_bytes()
    path = folder / "broken.hdr"
    if kind.startswith("truncated"):
        path.write_bytes(whole[: len(whole) * int(kind.split()[-1]) // 100])
    elif kind == "8-bit":
        png = folder / "small.png"
        cv2.imwrite(str(png), np.full((128, 256, 3), 90, np.uint8))
        path.write_bytes(png.read_bytes())
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "junk":
        path.write_bytes(bytes(range(256)) * 20)
    elif kind == "folder":
        path = folder / "folder.hdr"
        path.mkdir(exist_ok=True)
    elif kind == "missing":
        path = folder / "missing.hdr"
    elif kind == "wrong aspect":
        written(folder, noisy((200, 128)), path.name)
    elif kind == "tiny":
        written(folder, noisy((64, 32)), path.name)
    elif kind == "black":
        written(folder, np.zeros((128, 256, 3)), path.name)
    elif kind == "half black":
        written(folder, np.where(np.arange(128)[:, None, None] < 60, noisy(), 0.0), path.name)
    else:
        radiance = noisy()
        radiance[70, 3, 1] = {"NaN": np.nan, "infinite": np.inf, "negative": -1.0}[kind]
        path = written(folder, radiance, "broken.pfm")
    return path


DAMAGE = {
    **dict.fromkeys(
        ["truncated 1", "truncated 40", "truncated 99", "empty", "junk", "folder", "missing"], "can't be read"
    ),
    "8-bit": "not a high-dynamic-range color picture",
    "wrong aspect": "200 x 128 px; it must be twice as wide as high",
    "tiny": "64 x 32 px; it must be .* at least 128 x 64 px",
    **dict.fromkeys(["NaN", "infinite", "negative"], "contains negative, infinite or NaN values"),
    **dict.fromkeys(["black", "half black"], "more than half of it is black"),
}


@pytest.mark.parametrize(("kind", "says"), DAMAGE.items(), ids=DAMAGE)
def test_a_damaged_map_is_refused_by_name(folder, kind, says):
    path = damaged(folder, kind)
    with pytest.raises(InputError, match=rf"map {re.escape(path.name)}: .*{says}") as caught:
        Environment.read(path, MapRanges())
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", [b"m\xe4p.hdr", b"m%03dp.hdr"])
def test_a_map_of_any_name_is_read(folder, name):
    path = folder / os.fsdecode(name)
    written(folder, noisy()).rename(path)
    assert Environment.read(path, MapRanges()).name == path.stem


def test_an_unreadable_exr_says_what_may_be_missing(folder):
    path = folder / "broken.exr"
    path.write_bytes(bytes.fromhex("762f3101") + bytes(300))
    with pytest.raises(
        InputError, match=r"broken\.exr: can't be read.*many builds of OpenCV can't read EXR: save it as \.hdr"
    ):
        Environment.read(path, MapRanges())


def test_a_gray_map_is_refused(folder):
    path = folder / "gray.pfm"
    cv2.imwrite(str(path), noisy()[..., 0].astype(np.float32))
    with pytest.raises(InputError, match=r"gray\.pfm: not a high-dynamic-range color picture"):
        Environment.read(path, MapRanges())
