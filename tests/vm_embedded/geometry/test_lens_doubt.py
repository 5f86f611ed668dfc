"""Lens files in other units are noticed, and those of real cameras are not blamed."""

import math
from pathlib import Path

import pytest

from vm_embedded.geometry.calibrated_lenses import BrownLens, FisheyeLens
from vm_embedded.geometry.lens_doubt import lens_doubt
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, Rectilinear

FIXTURES = Path(__file__).parents[2] / "fixtures"

CIRCLE = {"focal_length": 300.0 / math.pi, "fov": math.pi}
"""A fisheye whose picture is a circle of 300 px."""


def brown(focal, center, size=(640, 480)):
    return BrownLens(fov=2.7, focal_lengths=(focal, focal), optical_center=center, size=size)


@pytest.mark.parametrize(
    ("lens", "says"),
    [
        (Rectilinear(focal_length=3.6, fov=1.66, size=(1280, 1024)), "a circle of 7.8"),
        (Equisolid(focal_length=1.4, fov=math.pi, size=(640, 512)), "a circle of 3.9"),
        (Equidistant(focal_length=0.42, fov=3.7), "a circle of 1.5"),
        (brown(0.42, (0.5, 0.5)), "optical center (0.5, 0.5)"),
        (brown(3.6, (320.0, 240.0)), "a circle of 31.9"),
        (FisheyeLens(fov=2 * math.pi, focal_lengths=(0.4, 0.4), optical_center=(319.5, 239.5)), "a circle of 2.5"),
        (brown(500.0, (3195.0, 240.0)), "optical center (3195, 240)"),
        (brown(500.0, (320.0, -30.0)), "optical center (320, -30)"),
        (brown(900.0, (639.5, 479.5)), "optical center (639.5, 479.5)"),
        (Rectilinear(focal_length=500.0, fov=1.5, center=(-400.0, 0.0)), "center [-400.0, 0.0]"),
        (Rectilinear(focal_length=500.0, fov=1.5, center=(320.0, 240.0)), "center [320.0, 240.0]"),
    ],
)
def test_what_is_strange_is_named(lens, says):
    assert says in lens_doubt(lens, (640, 480)).seen


@pytest.mark.parametrize(
    "lens",
    [
        Equidistant(**CIRCLE, size=(1280, 1024)),
        Equidistant(**CIRCLE, size=(1920, 1080)),
        Equidistant(**CIRCLE, center=(300.0, 0.0), size=(1280, 960)),  # one of two circles side by side
        Rectilinear(focal_length=8000.0, fov=0.1),
        brown(500.0, (250.0, 300.0)),
        BrownLens(fov=2.7, focal_lengths=(500.0, 500.0), optical_center=(320.0, 240.0), coefficients=(-0.4, 0.1, 0, 0)),
        FisheyeLens(fov=2 * math.pi, focal_lengths=(200.0, 100.0), optical_center=(319.5, 239.5)),
    ],
)
def test_unusual_lenses_are_not_blamed(lens):
    assert lens_doubt(lens, (640, 480)) is None


def test_real_lens_files_are_not_blamed(shared):
    checked = 0
    for folder, size in (
        (FIXTURES / "demo", (640, 512)),
        (FIXTURES / "drawn", (640, 512)),
        (shared / "real" / "images", (608, 800)),
        (shared / "reference" / "images", (1280, 1024)),
    ):
        for path in folder.glob("lens*.yaml"):
            assert lens_doubt(read_lens_file(path).lens, size) is None, path
            checked += 1
    assert checked > 60
