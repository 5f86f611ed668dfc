"""The plots of found objects."""

from vm_train.evaluation.object_plots import distance_errors
from vm_train.scores.object_scores import ObjectScores


def test_a_single_bin_shows_each_value_of_the_legend():
    """A line through one bin has no length, so its values need markers."""
    _, relative = distance_errors({"ball": ObjectScores()}).axes
    lines = relative.get_legend_handles_labels()[0]
    assert [each.get_marker() for each in lines] == [".", "."]
