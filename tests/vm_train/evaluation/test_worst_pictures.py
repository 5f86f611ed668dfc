"""Pictures of the worst errors show the outlines, and the object enlarged."""

from functools import partial

import numpy as np
import pytest

from vm_train.data.pictures import find_pictures
from vm_train.evaluation.worst_errors import WorstError
from vm_train.evaluation.worst_pictures import FOUND, TRUE, draw_error

from ..scores.test_overlaps import circle


@pytest.mark.parametrize("center", [(80.0, 64.0), (2.0, 125.0), (-30.0, 900.0)])
def test_small_pictures_show_outlines_and_the_place(drawn, center):
    files = find_pictures(drawn)[0]
    at = circle(*center, 9.0)
    content, outlines = partial(files.read, "image"), ((at,), (at + 3.0, at * 1e30))
    made = draw_error(WorstError(files.image, content, "ball", 1.0, at.mean(axis=0), 9.0, *outlines))
    assert made.shape == (200, 250 + 3 + 200, 3)
    nearest = min(np.abs(made.astype(int) - color).sum(axis=2).min() for color in (FOUND, TRUE))
    assert bool(nearest < 60) == (0.0 < center[0] < 160.0)
