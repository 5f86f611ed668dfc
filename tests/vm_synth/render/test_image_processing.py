"""Image processing: what each parameter of a sensor changes in a picture, and what it must leave alone."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from vm_synth.render.image_processing import (
    apply_exposure,
    blur_kernel,
    encode_jpeg,
    process_image,
    white_balance_gains,
)
from vm_synth.scene.sensor import MOSAICS, Sensor, SensorRanges, draw_sensor

IDEAL = Sensor()
DRAWN = [draw_sensor(np.random.default_rng(seed), SensorRanges()) for seed in range(40)]


def scene(height=96, width=128):
    """Turf, a white line, a ball and a lamp, in light of a bulb."""
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    light = np.full((height, width, 3), (0.05, 0.15, 0.05), np.float32)
    light *= 0.8 + 0.4 * np.random.default_rng(0).random((height, width, 1), dtype=np.float32)
    light[:30] = (0.12, 0.1, 0.1)
    light[np.abs(y - 50 - 0.2 * x) < 3] = 0.7
    light[np.hypot(x - 90, y - 45) < 9] = 0.6
    light[np.hypot(x - 30, y - 12) < 4] = 30.0
    return light * np.array([1.3, 1.0, 0.6], np.float32)


def flat(color, size=64):
    return np.full((size, size, 3), color, np.float32)


def spot(x, y, size=72):
    """A soft dot (18 times as bright as its surroundings) that a dark exposure keeps below white."""
    rows, columns = np.mgrid[0:size, 0:size]
    dot = np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / (2 * 1.5**2))
    return np.repeat((0.02 + 0.34 * dot)[..., None], 3, axis=2).astype(np.float32)


def linear(picture):
    levels = picture.astype(float) / 255.0
    return np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)


def weighted(picture, background):
    """Sum and center of mass (x, y) of green above the background."""
    light = linear(picture)[..., 1] - background
    light[np.abs(light) < 0.004] = 0.0
    rows, columns = np.mgrid[0 : light.shape[0], 0 : light.shape[1]]
    return light.sum(), np.array([(light * columns).sum(), (light * rows).sum()]) / light.sum()


@pytest.mark.parametrize("sensor", DRAWN[:12], ids=range(12))
def test_pictures_repeat_and_read_back(sensor):
    picture = process_image(scene(95, 127), sensor)
    assert picture.dtype == np.uint8
    assert picture.shape == (95, 127, 3)
    assert np.array_equal(picture, process_image(scene(95, 127), sensor))
    file = encode_jpeg(picture, sensor)
    assert file == encode_jpeg(picture, sensor)
    assert cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_COLOR).shape == picture.shape
    assert not np.array_equal(picture, process_image(scene(95, 127), replace(sensor, seed=sensor.seed + 1)))


def test_ideal_camera_is_plain_srgb():
    light = np.clip(apply_exposure(scene(), IDEAL), 0, 1).astype(float)
    levels = 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    assert np.abs(process_image(scene(), IDEAL)[..., ::-1] - levels).max() <= 1.0


def test_input_stays_as_it_was():
    light = scene()
    process_image(light, DRAWN[0])
    assert np.array_equal(light, scene())


@pytest.mark.parametrize("sensor", DRAWN[:6], ids=range(6))
def test_metering_makes_the_unit_of_radiance_irrelevant(sensor):
    difference = cv2.absdiff(process_image(scene(), sensor), process_image(scene() * np.float32(100.0), sensor))
    assert difference.max() <= 2
    assert difference.mean() < 0.01


def test_metering_finds_mid_gray_past_lamps_and_black_borders():
    assert apply_exposure(flat(7.0), IDEAL) == pytest.approx(0.18, rel=1e-4)
    assert apply_exposure(flat(7.0), replace(IDEAL, exposure=1.0)) == pytest.approx(0.36, rel=1e-4)
    light = flat(7.0)
    light[:30] = 0.0
    light[40:44, 40:44] = 1e5
    assert apply_exposure(light, IDEAL)[35, 0, 0] == pytest.approx(0.18, rel=1e-4)
    assert not process_image(flat(0.0), IDEAL).any()


def test_tone_curves_keep_mid_gray():
    for tone in ("srgb", "filmic"):
        assert process_image(flat(7.0), replace(IDEAL, tone=tone)) == pytest.approx(118, abs=1)
    assert process_image(flat(7.0), replace(IDEAL, tone="gamma", gamma=2.0)) == pytest.approx(255 * 0.18**0.5, abs=1)


def test_exposure_error_brightens():
    means = [process_image(scene(), replace(IDEAL, exposure=ev)).mean() for ev in (-1.0, 0.0, 1.0)]
    assert means[0] + 10 < means[1] < means[2] - 10


def test_white_balance_takes_the_color_out_of_light_but_not_out_of_turf():
    lit = apply_exposure(flat((1.3, 1.0, 0.6)), IDEAL)
    balanced = lit[0, 0] * white_balance_gains(lit, replace(IDEAL, balance=1.0))
    assert balanced == pytest.approx(np.full(3, balanced[1]), rel=0.1)
    assert white_balance_gains(lit, IDEAL) == pytest.approx(1.0)
    assert white_balance_gains(lit, replace(IDEAL, red=1.2, blue=0.8)) == pytest.approx([1.2, 1.0, 0.8])
    turf = apply_exposure(flat((0.04, 0.16, 0.03)), IDEAL)
    assert white_balance_gains(turf, replace(IDEAL, balance=1.0)) == pytest.approx(1.0, abs=0.15)


def test_overexposed_lamps_stay_white():
    light = flat(0.1)
    light[20:40, 20:40] = 50.0
    for saturation in (0.6, 1.5):
        assert process_image(light, replace(IDEAL, saturation=saturation))[30, 30].min() >= 254


@pytest.mark.parametrize("motion", [0.0, 1.0, 2.0, 3.5, 6.0, 7.0, 12.0])
@pytest.mark.parametrize("direction", [0.0, 0.3, math.pi / 4, math.pi / 2, 2.5])
def test_blur_keeps_light_and_its_place(motion, direction):
    for defocus in (0.0, 0.4, 2.0):
        dark = replace(IDEAL, exposure=-3.0)
        blurred = replace(dark, motion=motion, direction=direction, defocus=defocus)
        kernel = blur_kernel(blurred)
        around = np.arange(len(kernel)) - len(kernel) // 2
        assert kernel.sum() == pytest.approx(1.0, abs=1e-5)
        assert [kernel.sum(axis=0) @ around, kernel.sum(axis=1) @ around] == pytest.approx([0.0, 0.0], abs=1e-5)
        light = spot(35.3, 36.6)
        energy, place = weighted(process_image(light, dark), 0.18 / 8)
        blurred_energy, blurred_place = weighted(process_image(light, blurred), 0.18 / 8)
        assert blurred_place == pytest.approx(place, abs=0.05)
        assert blurred_energy == pytest.approx(energy, rel=0.05)


def test_motion_blur_goes_along_its_direction():
    kernel = blur_kernel(replace(IDEAL, motion=9.0, direction=0.0))
    assert (kernel.sum(axis=0) > 0.01).sum() >= 9
    assert kernel.sum(axis=1).max() == pytest.approx(1.0, abs=1e-5)


def test_lens_darkens_corners_and_parts_colors_there_but_not_green():
    sensor = replace(IDEAL, vignetting=0.4)
    light = linear(process_image(flat(1.0, 65), sensor))
    assert light[0, 0, 1] / light[32, 32, 1] == pytest.approx(0.6, abs=0.02)
    dot = spot(12.0, 12.0)
    dark = replace(IDEAL, exposure=-3.0)
    plain, fringed = process_image(dot, dark), process_image(dot, replace(dark, fringe=2.0))
    assert np.array_equal(plain[..., 1], fringed[..., 1])
    blue, _, red = (weighted(np.repeat(fringed[..., [each]], 3, axis=2), 0.18 / 8)[1] for each in range(3))
    assert (red < 11.7).all()
    assert (blue > 12.3).all()


def test_glare_lifts_what_is_dark():
    light = flat(1.0)
    light[20:40, 20:40] = 0.0
    assert process_image(light, IDEAL)[30, 30].max() == 0
    assert process_image(light, replace(IDEAL, glare=0.05))[30, 30].min() > 10


@pytest.mark.parametrize("mosaic", ["", "BGGR"])
def test_noise_grows_with_gain(mosaic):
    base = replace(IDEAL, full_well=10000.0, read_noise=3.0, row_noise=1.0, mosaic=mosaic)
    spread = [process_image(flat(1.0, 128), replace(base, gain=gain)).std(axis=(0, 1)).mean() for gain in (1, 4, 16)]
    assert 0.3 < spread[0] < 0.7 * spread[1] < 0.5 * spread[2] < 12


@pytest.mark.parametrize("mosaic", MOSAICS)
def test_mosaic_keeps_mean_colors(mosaic):
    light = flat((0.3, 0.15, 0.08), 65)
    light[20:40, 10:50] = (0.05, 0.2, 0.3)
    plain, seen = (linear(process_image(light, replace(IDEAL, mosaic=each))) for each in ("", mosaic))
    assert seen.mean(axis=(0, 1)) == pytest.approx(plain.mean(axis=(0, 1)), rel=0.02)
    assert np.abs(seen - plain)[25:35, 15:45].max() < 0.02


def test_saturation_contrast_and_sharpening():
    def picture(**settings):
        return process_image(scene(), replace(IDEAL, **settings)).astype(float)

    assert np.ptp(picture(saturation=0.0), axis=2).max() == 0
    assert np.ptp(picture(saturation=1.4), axis=2).mean() > np.ptp(picture(), axis=2).mean()
    assert picture(contrast=0.5).std() > picture().std() > picture(contrast=-0.5).std()
    assert np.abs(np.diff(picture(sharpening=1.0), axis=0)).mean() > np.abs(np.diff(picture(), axis=0)).mean()


def test_quality_and_chroma_lower_the_size():
    picture = process_image(scene(), replace(IDEAL, full_well=4000.0))
    sizes = [len(encode_jpeg(picture, replace(IDEAL, quality=quality))) for quality in (95, 75, 40)]
    assert sizes[0] > sizes[1] > sizes[2]
    assert len(encode_jpeg(picture, replace(IDEAL, chroma="4:2:0"))) < sizes[0]
    assert len(encode_jpeg(picture, replace(IDEAL, earlier_quality=30))) < sizes[0]
