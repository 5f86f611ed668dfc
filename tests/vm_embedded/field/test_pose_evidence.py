"""Evidence about the pose: lines and balls of a plane, seen with a pose that is slightly wrong, tell the error.

Real lines are found near right angles, so that exact ones overstate errors by up to a third.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.field.pose_evidence import (
    ERRORS,
    EXPECTED,
    HEIGHT,
    NOTHING,
    BallClues,
    Clues,
    LineClues,
    evidence_of,
    solved,
)
from vm_embedded.geometry.orientation import Orientation

RADIUS, TRUE_HEIGHT, PIXEL = 0.08, 0.7, 1.0 / 400.0
ANGLES = st.floats(-0.03, 0.03)
SCALES = st.floats(-0.08, 0.08)


def as_assumed(rays, errors):
    """Rays (n, 3) of the true level frame, as a camera whose pose has these errors believes them to be."""
    pitch, roll = errors[:2]
    turn = Orientation.from_roll_pitch(1.0, roll, pitch).rotation
    return rays @ turn  # the transposed rotation of each


def on_plane(places, errors):
    """Places (n, 2) of the plane, where a camera with errors believes them to be."""
    height = TRUE_HEIGHT / math.exp(errors[2])
    rays = as_assumed(np.column_stack([places, np.full(len(places), -TRUE_HEIGHT)]), errors)
    return rays[:, :2] * (height / -rays[:, 2:]), height


def lines(errors, random, heading, width=0.06, count=8):
    """Lines of a field, as LineClues: parallel and at right angles, to both sides, up to 3 m away."""
    ends, widths = [], []
    for number in range(count):
        angle = heading + 0.5 * math.pi * (number % 2)
        along, across = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
        middle = np.array([random.uniform(0.8, 3.0), random.uniform(-1.5, 1.5)])
        edges = [middle + 0.4 * side * along + 0.5 * width * other * across for side in (-1, 1) for other in (-1, 1)]
        seen, height = on_plane(np.array(edges), errors)
        start, end = seen[:2].mean(axis=0), seen[2:].mean(axis=0)
        normal = np.array([-(end - start)[1], (end - start)[0]]) / np.linalg.norm(end - start)
        middles = 0.5 * (seen[[0, 1]] + seen[[2, 3]])
        ends.append([start, end])
        widths.append(abs(float((middles[1] - middles[0]) @ normal)))
    return LineClues(np.array(ends), np.full(count, 0.003), np.array(widths)), height


def balls(errors, random, count=8):
    """Balls, as BallClues: their size is true, and the expected size is that of the assumed pose."""
    places = np.column_stack([random.uniform(0.5, 3.0, count), random.uniform(-1.5, 1.5, count)])
    true = np.column_stack([places, np.full(count, RADIUS - TRUE_HEIGHT)])
    distances = np.linalg.norm(true, axis=1)
    bearings = as_assumed(true / distances[:, None], errors)
    height = TRUE_HEIGHT / math.exp(errors[2])
    assumed = (height - RADIUS) / -bearings[:, 2]
    one = np.ones(count)
    return BallClues(bearings, assumed / distances, 30.0 * one, one, height / (height - RADIUS), PIXEL)


def estimate(clues):
    errors = np.zeros(ERRORS)
    for _ in range(4):
        errors, deviations = solved(evidence_of(clues, errors))
    return errors, deviations


@given(st.integers(0, 99), ANGLES, ANGLES, SCALES, st.floats(-3.0, 3.0))
def test_lines_and_balls_tell_pitch_roll_and_height(seed, pitch, roll, height, heading):
    random = np.random.default_rng(seed)
    true = (pitch, roll, height)
    seen, assumed = lines(true, random, heading)
    errors, deviations = estimate(Clues(seen, balls(true, random), assumed))
    assert errors[:2] == pytest.approx(true[:2], abs=0.02)
    assert errors[HEIGHT] == pytest.approx(height, abs=0.05)
    assert (deviations[:2] < 0.02).all()
    assert deviations[HEIGHT] < 0.06


@given(st.integers(0, 99), ANGLES, ANGLES, st.floats(-3.0, 3.0))
def test_lines_of_an_unknown_width_tell_angles_and_no_height(seed, pitch, roll, heading):
    random = np.random.default_rng(seed)
    seen, assumed = lines((pitch, roll, 0.0), random, heading, width=random.uniform(0.05, 0.12))
    nothing = balls((0.0, 0.0, 0.0), random, 0)
    errors, deviations = estimate(Clues(seen, nothing, assumed))
    assert np.abs(errors[:2] - (pitch, roll)) == pytest.approx(0.0, abs=0.02)
    assert deviations[HEIGHT] > 0.25


def test_lines_that_are_no_field_count_less_than_those_that_are():
    random = np.random.default_rng(1)
    seen, height = lines((0.0, 0.0, 0.0), random, 0.4)
    odd, _ = lines((0.0, 0.0, 0.0), random, 0.65, count=2)
    mixed = LineClues(*(np.concatenate(pair) for pair in zip(seen, odd, strict=True)))
    errors, _ = estimate(Clues(mixed, balls((0.0, 0.0, 0.0), random, 0), height))
    assert np.abs(errors[:2]) == pytest.approx(0.0, abs=0.01)


def test_without_clues_nothing_is_known():
    empty = Clues(LineClues(np.empty((0, 2, 2)), np.empty(0), np.empty(0)), balls((0, 0, 0), np.random, 0), 0.7)
    assert evidence_of(empty, np.zeros(ERRORS)).gain == 0.0
    errors, deviations = solved(evidence_of(empty, np.zeros(ERRORS)) + NOTHING)
    assert (errors == 0.0).all()
    assert deviations == pytest.approx(EXPECTED)
