"""Straight lines, the circle and crossings of drawn fields are found where they are drawn."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.field.circle import find_circle
from vm_embedded.field.lines import LEAST, _best_stretches, find_pieces, line_points

from .ground import ground, mesh, near_segment, turned

ANGLES = st.floats(-3.1, 3.1)


def near(lines=(), circle=None, angle=0.0, seed=None):
    """All points near enough for lines of a field with straight lines (start, end) and a circle (center, radius), 8 cm
    wide."""
    places = mesh()
    off = np.full(len(places), np.inf)
    for start, end in lines:
        off = np.minimum(off, near_segment(places, start, end))
    if circle is not None:
        off = np.minimum(off, np.abs(np.hypot(*(places - circle[0]).T) - circle[1]))
    # Between rings the mesh would miss a line; a network sees it from the blurred colors of the points beside it.
    rings = 0.35 * 0.06 * np.hypot(np.hypot(*places.T), 0.9) / 0.9
    labels = np.where(off < 0.04 + rings * np.abs(places[:, 0]) / np.hypot(*places.T), "line", "field")
    if seed is not None:
        labels[np.random.default_rng(seed).random(len(places)) < 0.01] = "line"
    return line_points(ground(places @ turned(angle), labels))


def drawn(*args, **keywords):
    """Those of these points that are on lines."""
    points = near(*args, **keywords)
    return points.part(np.flatnonzero(points.weights > LEAST))


def pieces_of(*args, **keywords):
    return find_pieces(near(*args, **keywords), drawn(*args, **keywords))


@given(angle=ANGLES, seed=st.integers(0, 100))
def test_lines_at_right_angles_are_found_among_scattered_points(angle, seed):
    lines = [((1.0, -2.0), (1.0, 2.0)), ((1.0, 1.0), (5.0, 1.0))]
    pieces = pieces_of(lines, angle=angle, seed=seed)
    for start, end in lines:
        a, b = np.array([start, end]) @ turned(angle)
        longer = 0.75 * (b - a) / np.hypot(*(b - a))  # two rings: a scattered point there prolongs it
        best = min(pieces, key=lambda each: max(near_segment(each.ends, a - longer, b + longer)) - 0.1 * each.length)
        assert max(near_segment(best.ends, a - longer, b + longer)) < 0.15
        assert best.length > 0.7 * np.hypot(*(b - a))


def test_a_gap_divides_a_line():
    pieces = pieces_of([((1.5, -2.3), (1.5, -0.8)), ((1.5, 0.8), (1.5, 2.3))])
    assert sorted(round(each.length, 1) for each in pieces[:2]) == pytest.approx([1.5, 1.5], abs=0.2)


def test_every_point_belongs_to_one_piece_at_most():
    pieces = pieces_of([((1.0, -2.0), (1.0, 2.0)), ((1.0, 1.0), (5.0, 1.0))], seed=1)
    members = np.concatenate([each.members for each in pieces])
    assert len(np.unique(members)) == len(members)


def test_a_field_without_lines_has_none():
    assert pieces_of() == []
    assert find_circle(drawn(), np.arange(0)) is None


def test_points_that_see_no_line_end_a_piece():
    """Its support is what its points have above 0.1, and the longest stretches of points with a line are kept."""
    (piece,) = pieces_of([((1.5, -1.0), (1.5, 1.0))])
    assert piece.length == pytest.approx(2.0, abs=0.2)
    assert piece.support == pytest.approx(0.85 * len(piece.members), rel=0.2)


@given(st.lists(st.integers(-9, 9), max_size=30), st.floats(0.5, 20.0))
def test_the_best_stretch_has_the_largest_sum_and_the_others_are_beside_it(numbers, least):
    values = np.array(numbers, dtype=np.float64)
    found = _best_stretches(values, np.zeros(len(values), np.intp), least, np.inf)
    sums = [values[first : last + 1].sum() for first, last, _ in found]
    assert sums == pytest.approx([each for _, _, each in found])
    assert all(each >= least for each in sums)
    ends = sorted((first, last) for first, last, _ in found)
    assert all(one[1] < other[0] for one, other in pairwise(ends))
    largest = max((values[i:j].sum() for i in range(len(values)) for j in range(i + 1, len(values) + 1)), default=0.0)
    assert max(sums, default=0.0) == (pytest.approx(largest) if largest >= least else 0.0)


def test_a_long_row_of_values_below_zero_is_in_no_stretch():
    values = np.array([5.0, -1.0, 5.0, -2.0, -2.0, 5.0])
    assert [each[:2] for each in _best_stretches(values, np.zeros(6, np.intp), 1.0, 5.0)] == [(0, 5)]
    assert sorted(each[:2] for each in _best_stretches(values, np.zeros(6, np.intp), 1.0, 3.0)) == [(0, 2), (5, 5)]


def test_all_lines_share_two_directions():
    """A short line alone would be fitted to few points; the long ones tell its direction."""
    long = [((1.0, -3.0), (1.0, 3.0)), ((2.0, -3.0), (2.0, 3.0))]
    pieces = pieces_of([*long, ((3.0, -0.4), (3.0, 0.4))], angle=0.3)
    short = min(pieces, key=lambda each: each.length)
    x, y = (short.ends[1] - short.ends[0]) @ turned(-0.3)
    assert abs(x / y) < 0.02


@given(angle=ANGLES, x=st.floats(1.5, 3.5), y=st.floats(-0.5, 0.5), radius=st.floats(0.5, 1.2))
def test_the_circle_is_found(angle, x, y, radius):
    points = drawn(circle=(np.array([x, y]), radius), angle=angle)
    found = find_circle(points, np.arange(len(points)))
    assert found is not None
    assert np.hypot(*(found.center @ turned(-angle) - (x, y))) < 0.06
    assert found.radius == pytest.approx(radius, abs=0.05)


def test_scattered_points_are_no_circle():
    points = drawn(seed=3)
    assert find_circle(points, np.arange(len(points))) is None


def test_a_few_points_are_no_circle():
    points = drawn(circle=(np.array([2.0, 0.0]), 0.75))
    few = np.linspace(0, len(points) - 1, 17).astype(np.intp)
    assert find_circle(points, np.arange(len(points))) is not None
    assert find_circle(points.part(few), np.arange(len(few))) is None


def test_the_same_points_have_the_same_circle():
    points = drawn([((0.5, 0.0), (5.0, 0.0))], circle=(np.array([2.0, 0.0]), 0.75))
    off_the_line = np.flatnonzero(np.abs(points.positions[1]) > 0.1)
    one, other = (find_circle(points, off_the_line) for _ in range(2))
    assert (one.center == other.center).all()
    assert one.radius == other.radius
