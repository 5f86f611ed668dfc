"""Tables and summaries."""

import pytest

from vm_workstation.text_tables import aligned, shortened, summary


def test_the_first_column_is_flush_left_and_the_others_flush_right():
    assert aligned([["", "a", "long"], ["name", "10", "2"]]) == ["       a  long", "name  10     2"]


def test_a_summary_is_right():
    assert summary([float(each) for each in range(101)]) == {
        "least": 0.0,
        "5 %": 5.0,
        "median": 50.0,
        "mean": 50.0,
        "95 %": 95.0,
        "largest": 100.0,
    }


@pytest.mark.parametrize(
    ("most", "found"), [(4, ["a", "b", "c"]), (3, ["a", "b", "c"]), (2, ["a", "b", "and 1 more; see there"])]
)
def test_it_says_how_many_lines_it_leaves_out(most, found):
    assert shortened(["a", "b", "c"], most, "; see there") == found
