"""Laws of bounding boxes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vm_embedded.output.box_files import bounding_box, edges, overlap

SIZE = 200, 100
OUTLINES = arrays(float, st.tuples(st.integers(3, 12), st.just(2)), elements=st.floats(-300.0, 300.0))
SHARES = st.tuples(*[st.floats(0.0, 1.0)] * 2, *[st.floats(0.01, 1.0)] * 2)


@given(OUTLINES)
def test_a_box_holds_the_visible_part_of_the_outline(outline):
    shares = bounding_box(outline, SIZE)
    low, high = outline.min(axis=0), outline.max(axis=0)
    visible = np.minimum(high + 0.5, SIZE) - np.maximum(low + 0.5, 0.0)
    assert (shares is None) == (visible.min() < 2.0)
    if shares is not None:
        center, sides = np.array(shares[:2]) * SIZE - 0.5, np.array(shares[2:]) * SIZE
        np.testing.assert_allclose(center - sides / 2, np.maximum(low, -0.5), atol=1e-3)
        np.testing.assert_allclose(center + sides / 2, np.minimum(high, np.array(SIZE) - 0.5), atol=1e-3)


@pytest.mark.parametrize(
    "outline", [np.empty((0, 2)), np.ones((2, 2)), np.full((4, 2), np.nan), np.full((4, 2), np.inf)]
)
def test_an_outline_that_is_none_has_no_box(outline):
    assert bounding_box(outline, SIZE) is None


@given(SHARES, SHARES, st.floats(-0.5, 0.5))
def test_overlap_is_symmetric_and_moves_with_both(a, b, shift):
    one, other = edges(a), edges(b)
    both = overlap(one, other)
    assert 0.0 <= both <= 1.0 + 1e-9
    assert both == pytest.approx(overlap(other, one))
    moved = [edges((x + shift, *rest)) for x, *rest in (a, b)]
    assert overlap(*moved) == pytest.approx(both, abs=1e-6)
    assert overlap(one, one) == pytest.approx(1.0)


def test_half_covered_boxes_overlap_by_a_third():
    assert overlap((20.0, 3.0, 40.0, 7.0), (30.0, 3.0, 50.0, 7.0)) == pytest.approx(1 / 3)
    assert overlap((15.0, 3.0, 25.0, 7.0), (75.0, 3.0, 85.0, 7.0)) == 0.0
    assert overlap((15.0, 3.0, 15.0, 7.0), (15.0, 3.0, 15.0, 7.0)) == 0.0
