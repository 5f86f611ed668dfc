"""The axes that plots share."""

import numpy as np
from matplotlib.figure import Figure

from vm_train.evaluation.axes import distance_axis


def test_a_distance_axis_ends_after_the_last_bin_that_is_not_empty():
    axes, edges = Figure().subplots(), np.array([0.0, 0.5, 1.0, 1.5])
    distance_axis(axes, edges, [0, 2, 0])
    assert axes.get_xlim() == (0.0, 1.0)
    distance_axis(axes, edges, [0, 0, 0])
    assert axes.get_xlim() == (0.0, 1.5)
