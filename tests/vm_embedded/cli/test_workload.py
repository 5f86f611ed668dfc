"""The walk and the drawn field that vm-bench measures on."""

import pytest

from vm_embedded import Orientation
from vm_embedded.cli.workload import SWAY, SWING, draw_empty_field, walk
from vm_embedded.detection.pixel_formats import FORMATS, checked_image


def test_a_walk_swings_as_far_as_it_says():
    middle = Orientation.from_roll_pitch(0.8, 0.05, 0.4)
    steps = walk(middle, 90)
    for values, center, reach in (
        ([each.roll for each in steps], 0.05, SWING),
        ([each.pitch for each in steps], 0.4, SWING),
        ([each.height for each in steps], 0.8, SWAY),
    ):
        assert max(values) <= center + reach + 1e-9
        assert max(values) >= center + 0.9 * reach - 1e-9
        assert min(values) <= center - 0.9 * reach + 1e-9


def test_no_two_frames_of_a_walk_are_the_same():
    steps = walk(Orientation.from_roll_pitch(0.8, 0.0, 0.4), 1800)
    assert len({(round(each.roll, 6), round(each.pitch, 6)) for each in steps}) == 1800


@pytest.mark.parametrize("format", FORMATS)
def test_the_drawn_field_is_a_frame_of_every_format(format):
    assert checked_image(draw_empty_field((64, 48), format), format).shape[:2] == (48, 64)
