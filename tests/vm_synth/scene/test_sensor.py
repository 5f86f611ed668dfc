"""Sensors are drawn within their ranges and repeat."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_synth.scene.sensor import CHROMAS, MOSAICS, TONES, Sensor, SensorRanges, draw_sensor

DRAWN = [draw_sensor(np.random.default_rng(seed), SensorRanges()) for seed in range(40)]


def test_drawn_sensors_repeat_and_are_json():
    again = [draw_sensor(np.random.default_rng(seed), SensorRanges()) for seed in range(40)]
    assert again == DRAWN
    assert len({sensor.seed for sensor in DRAWN}) == 40
    assert [Sensor(**json.loads(json.dumps(asdict(sensor)))) for sensor in DRAWN] == DRAWN
    assert {sensor.tone for sensor in DRAWN} == set(TONES)
    assert {sensor.mosaic for sensor in DRAWN} == {"", *MOSAICS}
    assert {sensor.chroma for sensor in DRAWN} == set(CHROMAS)


def test_shares_switch_effects_off_and_leave_the_other_draws():
    none = SensorRanges(defocus_share=0, motion_share=0, mosaic_share=0, again_share=0)
    for seed, sensor in enumerate(DRAWN):
        plain = draw_sensor(np.random.default_rng(seed), none)
        assert plain == replace(sensor, defocus=0.0, motion=0.0, mosaic="", earlier_quality=0)


def test_as_many_pictures_as_configured_are_overexposed():
    ranges = SensorRanges(exposure=(-2.0, 0.0), bright_share=0.3, bright=(1.0, 2.0))
    exposures = np.array([draw_sensor(np.random.default_rng(seed), ranges).exposure for seed in range(400)])
    assert np.mean(exposures >= 1.0) == pytest.approx(0.3, abs=0.07)
    assert ((exposures <= 0.0) | ((exposures >= 1.0) & (exposures <= 2.0))).all()


@pytest.mark.parametrize(
    "entries",
    [
        {"exposure": (1.0, -1.0)},
        {"quality": (0, 90)},
        {"gains": (0.0, 1.0)},
        {"mosaic_share": 1.5},
        {"tones": ("log",)},
        {"patterns": ()},
        {"defocus": 2.0},
    ],
    ids=lambda entries: next(iter(entries)),
)
def test_bad_ranges_are_refused_by_name(entries):
    with pytest.raises(InputError, match=next(iter(entries))):
        SensorRanges(**entries)
