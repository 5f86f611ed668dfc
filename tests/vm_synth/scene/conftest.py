"""Fixtures of this room's tests."""

from dataclasses import replace

import pytest

from vm_synth.scene.configuration import TargetRanges, ThingRanges

from .drawn import DEFAULT, FLOOR, scenes


@pytest.fixture(scope="session")
def crowded():
    """Scenes with much around, on fields and on photographed floors."""
    configuration = replace(
        DEFAULT,
        things=ThingRanges(robots=(1, 2), clutter=(2, 4), round_things=(0, 2), carrier=0.7),
        ball=TargetRanges(missing=0.1, hidden=0.5, off_plane=0.4, wrong_size=0.4),
        ground=replace(DEFAULT.ground, photographed=1.0),
    )
    return scenes(60, configuration) + scenes(40, configuration, FLOOR)
