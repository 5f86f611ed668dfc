"""The hint that the objects have another size than the detector expects."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.cli.closing_remarks import size_hint, size_ratios

from .commands import run
from .test_detect_files import DEMO


def test_the_radius_that_would_fit_is_named_after_all_frames():
    folder = DEMO.parent
    said = run(folder, "--model", "ball", "--object-radius", 0.075).stderr
    radius = float(said.split("0.075; ")[1].split(" would fit")[0])
    assert radius == pytest.approx(0.095, abs=0.004)
    assert run(folder, "--model", "ball").stderr == ""


@given(st.floats(0.3, 3.0), st.floats(0.0, 0.01), st.integers(5, 30))
def test_a_hint_needs_objects_that_agree_on_another_size(ratio, spread, count):
    ratios = [ratio * (1.0 + spread * (number % 3 - 1)) for number in range(count)]
    assert bool(size_hint(ratios, 0.1)) == (abs(ratio - 1.0) >= 0.1)
    assert size_hint(ratios[:4], 0.1) == ""
    assert size_hint([*ratios, *[ratio + 0.5] * count], 0.1) == ""


def test_only_large_objects_are_measured():
    class Far:
        radius, distance, distance_by_angle = 5.0, 9.0, 7.0

    class Near:
        radius, distance, distance_by_angle = 6.0, 1.2, 1.0

    assert size_ratios([Far(), Near()]) == [1.2]
