"""Designs of balls are drawn within their ranges and repeat."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_synth.balls.design import BallDesign
from vm_synth.balls.draw_design import DesignRanges, draw_design
from vm_synth.balls.patterns import PATTERNS


def designs(count: int, seed: int = 0, ranges: DesignRanges | None = None) -> list[BallDesign]:
    random = np.random.default_rng(seed)
    return [draw_design(random, ranges or DesignRanges()) for _ in range(count)]


def test_draws_are_the_same_for_the_same_chance():
    assert designs(20, seed=5) == designs(20, seed=5)
    assert designs(20, seed=5) != designs(20, seed=6)


def test_every_kind_occurs():
    assert {design.kind for design in designs(1500)} == set(PATTERNS)
    assert {design.kind for design in designs(30, ranges=DesignRanges(kinds=("dots", "plain")))} == {"dots", "plain"}


def test_shares_of_nought_and_one_hold():
    no_white = designs(50, ranges=DesignRanges(white=0.0, dark=1.0, bright=0.0, worn=0.0, marked=0.0))
    assert all(max(design.base) < 0.06 and design.wear == 0 and design.marks == 0 for design in no_white)
    bright = designs(50, ranges=DesignRanges(bright=1.0))
    assert all(min(*design.base, *design.ink, *design.accent) > 0.8 for design in bright)


def test_the_surface_stays_in_its_ranges():
    for design in designs(200, ranges=DesignRanges(roughness=(0.05, 1.0))):
        assert 0.05 <= design.roughness <= 1
        assert 0 <= design.specular <= 1
        assert 0 <= design.clearcoat <= 1
    assert all(0.3 <= design.roughness <= 0.4 for design in designs(50, ranges=DesignRanges(roughness=(0.3, 0.4))))


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
        DesignRanges(**{entry: value})
