"""Pieces of lines move to the bright ridges of the picture, and need one, or many points that speak for them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.field import ridges
from vm_embedded.field.lines import Piece

from .ground import ground, mesh, near_segment, turned


def pieces_on_ridges(*given):
    return ridges.pieces_on_ridges(*given)[0]


FIELD = ground(mesh(), np.full(len(mesh()), "field"))


def piece(start, end, support=3.0):
    return Piece(np.array([start, end], float), np.arange(5), support)


def picture(*lines, width=0.06, line=200.0, field=90.0, pixel=0.004):
    """Profiles of a picture with bright lines (start, end) and pixels of one size [m] everywhere."""

    def profiles(stretches, count):
        at = np.linspace(0.0, 1.0, count)[:, None]
        places = (1.0 - at) * stretches[:, None, 0] + at * stretches[:, None, 1]
        off = np.full(places.shape[:2], np.inf)
        for start, end in lines:
            off = np.minimum(off, near_segment(places.reshape(-1, 2), start, end).reshape(off.shape))
        lengths = np.hypot(*(stretches[:, 1] - stretches[:, 0]).T)
        return np.where(off < width / 2.0, line, field).astype(np.float32), lengths / (count - 1) / pixel

    return profiles


@given(angle=st.floats(-3.1, 3.1), shifts=st.tuples(st.floats(-0.06, 0.06), st.floats(-0.06, 0.06)))
def test_a_piece_moves_to_its_ridge(angle, shifts):
    ends = np.array([[2.0, -1.5], [2.0, 1.5]])
    off = ends + np.array([[shifts[0], 0.0], [shifts[1], 0.0]])
    (moved,) = pieces_on_ridges([piece(*(off @ turned(angle)))], FIELD, picture(ends @ turned(angle)))
    assert np.abs(moved.ends @ turned(-angle) - ends)[:, 0].max() < 0.03


def test_each_piece_moves_to_its_own_ridge():
    lines = [((2.0, -1.5), (2.0, 1.5)), ((0.5, 1.0), (4.0, 1.0))]
    off = [piece((2.05, -1.5), (2.05, 1.5)), piece((0.5, 0.97), (4.0, 0.97))]
    moved = pieces_on_ridges(off, FIELD, picture(*lines))
    assert all(near_segment(each.ends, *line).max() < 0.03 for each, line in zip(moved, lines, strict=True))
    alone = [pieces_on_ridges([each], FIELD, picture(*lines))[0] for each in off]
    for one, together in zip(alone, moved, strict=True):
        assert one.ends == pytest.approx(together.ends)


@pytest.mark.parametrize("support", [2.0, 20.0])
def test_without_a_ridge_no_support_is_enough(support):
    assert pieces_on_ridges([piece((2.0, -1.0), (2.0, 1.0), support)], FIELD, picture()) == []


@pytest.mark.parametrize(("support", "kept"), [(1.0, False), (5.0, True)])
def test_half_a_ridge_needs_more_support(support, kept):
    half = picture(((2.0, -1.0), (2.0, 0.0)))
    assert bool(pieces_on_ridges([piece((2.0, -1.0), (2.0, 1.0), support)], FIELD, half)) == kept


def test_the_edge_of_something_bright_is_no_ridge():
    wide = picture(((3.0, -5.0), (3.0, 5.0)), width=2.0)
    assert pieces_on_ridges([piece((2.0, -1.0), (2.0, 1.0))], FIELD, wide) == []


def test_outside_of_the_picture_is_no_ridge():
    def outside(stretches, count):
        return np.full((len(stretches), count), np.nan, dtype=np.float32), np.zeros(len(stretches))

    assert pieces_on_ridges([piece((2.0, -1.0), (2.0, 1.0))], FIELD, outside) == []


def test_brightness_of_the_picture_hardly_matters():
    line = ((2.0, -1.0), (2.0, 1.0))
    for light in (0.3, 1.0):
        (moved,) = pieces_on_ridges(
            [piece((2.05, -1.0), (2.05, 1.0))], FIELD, picture(line, line=200.0 * light, field=90.0 * light)
        )
        assert near_segment(moved.ends, *line).max() < 0.03


def test_no_pieces_need_no_picture():
    assert pieces_on_ridges([], FIELD, picture()) == []


@given(
    angle=st.floats(-3.1, 3.1),
    width=st.floats(0.05, 0.11),
    shifts=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)),
)
def test_edges_tell_the_width_of_a_line_and_its_direction(angle, width, shifts):
    true = np.array([[1.2, -0.8], [1.2, 0.8]])
    off = true + np.array([[shifts[0], 0.0], [shifts[1], 0.0]])
    found = ridges.pieces_on_ridges([piece(*(off @ turned(angle)))], FIELD, picture(true @ turned(angle), width=width))
    ends, turn_errors, widths = found[1].measured()
    assert np.abs(ends[0] @ turned(-angle) - true)[:, 0].max() < 0.012
    assert turn_errors[0] < 0.02
    assert widths[0] == pytest.approx(width, rel=0.25)


def test_a_line_without_edges_is_not_measured():
    def flat(stretches, count):
        return np.full((len(stretches), count), 90.0, np.float32), np.full(len(stretches), 3.0)

    assert all(
        len(each) == 0 for each in ridges.pieces_on_ridges([piece((2.0, -1.0), (2.0, 1.0))], FIELD, flat)[1].measured()
    )
