"""Tables and summaries."""

from vm_workstation.text_tables import aligned, summary


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
