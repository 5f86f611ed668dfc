"""Long lists of lines."""

import pytest

from vm_workstation.shortened import shortened


@pytest.mark.parametrize(
    ("most", "found"), [(4, ["a", "b", "c"]), (3, ["a", "b", "c"]), (2, ["a", "b", "and 1 more; see there"])]
)
def test_it_says_how_many_lines_it_leaves_out(most, found):
    assert shortened(["a", "b", "c"], most, "; see there") == found
