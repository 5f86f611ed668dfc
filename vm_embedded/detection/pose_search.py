"""Search for the pose with which frames look like a field.

Evidence (field/pose_evidence.py) is linear: it holds for small errors only. So the search detects again with each better
pose, as in Gauss and Newton's method, and from several pitches and heights. The pose counts with which the clues agree
best.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import AnyImage, Floats
from ..errors import GeometryError
from ..field.pose_evidence import ERRORS, EXPECTED, HEIGHT, NOTHING, WIDTH, evidence_of, of_balls, solved
from ..geometry.lens import Lens
from ..geometry.orientation import Orientation
from .detector import Detector
from .pose_check import clues_of
from .pose_state import PoseState

_PITCHES = np.radians([0.0, 8.0, -8.0, 17.0, -17.0, 28.0]).tolist()
"""Errors of the pitch that are tried."""

_HEIGHTS = np.log([1.0, 0.7, 1.4, 0.5, 2.0, 0.35, 2.8]).tolist()
"""Errors of the height that are tried."""

_FEW_HEIGHTS = np.log([1.0, 0.5, 2.0]).tolist()
"""Those that are tried with each pitch."""

_SOME_VIEWS = 3
"""Frames that are looked at with each start."""

_REFINED = 3
"""Best starts that are refined."""

_BALLS_COUNT, _LEFT_COUNTS = 2.0, 5.0
"""See `rank`."""

_LARGEST = np.array([math.radians(12.0), math.radians(8.0), 0.3, 0.0])
"""Largest step: evidence is linear only near a pose."""

_CLOSE = np.array([math.radians(0.2), math.radians(0.2), 0.01, 0.01])
"""A smaller step is the last."""

_STEPS = 7
"""Steps of a refinement, at most."""

_SOLUTIONS = 4
"""Solutions of the clues of the same frames: each tells outliers better."""

_LEAST = 4.0
"""Gain below which frames show nothing that tells about the pose."""

_BETTER, _SURE = 1.15, 4.0
"""A better pose has a gain that is larger by this factor and this number."""

_SURE_BALLS = 2.5
"""Gain of balls from which they tell the height."""

_OFF, _OFF_HEIGHT = math.radians(2.0), 0.12
"""Least errors of a pose that is wrong."""

_SCALED = 0.15
"""Standard deviation of the height from which it is not known at all: then only balls of other heights tell."""


@dataclass(frozen=True, eq=False)
class View:
    """A frame with its lens and the pose that is assumed."""

    image: AnyImage
    lens: Lens
    orientation: Orientation


@dataclass(frozen=True, eq=False)
class Tried:
    """Frames seen with corrected poses.

    errors (ERRORS,): the correction. step (ERRORS,): what the clues still add to it. deviations (ERRORS,): standard
    deviations of the step. gain, ball_gain: see Evidence.gain, of all clues and of balls, with no further step. balls,
    lines: numbers of clues.
    """

    errors: Floats
    step: Floats
    deviations: Floats
    gain: float
    ball_gain: float
    balls: int
    lines: int


def corrected(orientation: Orientation, errors: Floats) -> Orientation:
    """The orientation without these errors (ERRORS,)."""
    pitch, roll, height = errors[:WIDTH].tolist()
    return Orientation.from_roll_pitch(
        orientation.height * math.exp(height), orientation.roll + roll, orientation.pitch + pitch, orientation.yaw
    )


def search(detector: Detector, views: Sequence[View], angles_known: bool = False) -> tuple[Tried, Tried]:
    """The poses as they are, and without their errors, found from far away.

    angles_known: pitch and roll are right, or nearly.
    """
    given = look(detector, views, np.zeros(ERRORS))
    some = views[:: -(-len(views) // _SOME_VIEWS)]
    pitches = [0.0] if angles_known else _PITCHES
    starts = [
        look(detector, some, np.array([pitch, 0.0, height, 0.0]))
        for height in (_HEIGHTS if angles_known else _FEW_HEIGHTS)
        for pitch in pitches
    ]
    best = given
    for each in sorted(starts, key=rank, reverse=True)[:_REFINED]:
        if each.gain > _LEAST:
            best = max(best, refined(detector, views, each), key=rank)
    if best is given:
        return given, given
    heights = [look(detector, views, best.errors + [0.0, 0.0, each, 0.0]) for each in _HEIGHTS if each]
    return given, refined(detector, views, max([best, *heights], key=rank))


def with_search(state: PoseState, detector: Detector, views: Sequence[View]) -> PoseState:
    """What frames say, with what a search adds to it: errors that are too large for the evidence of small ones."""
    if state.verdict == "consistent" and state.height is not None:
        return state
    given, found = search(detector, views, state.verdict == "consistent")
    pitch, roll, height = (found.errors + np.clip(found.step, -_LARGEST, _LARGEST))[:WIDTH].tolist()
    has_scale = found.ball_gain > max(_SURE_BALLS, given.ball_gain + 1.0)
    is_off = max(abs(pitch), abs(roll)) > _OFF or (has_scale and abs(height) > _OFF_HEIGHT)
    if not is_off or found.gain < given.gain * _BETTER + _SURE:
        return state
    return PoseState(
        verdict="wrong",
        pitch=math.degrees(pitch),
        roll=math.degrees(roll),
        height=100.0 * math.expm1(height) if has_scale else None,
        frames=len(views),
        balls=found.balls,
        lines=found.lines,
    )


def refined(detector: Detector, views: Sequence[View], tried: Tried) -> Tried:
    """The best correction near one that was tried."""
    best: Tried | None = None
    for _ in range(_STEPS):
        step = np.clip(tried.step, -_LARGEST, _LARGEST)
        if best is not None and (np.abs(step) < _CLOSE).all():
            break
        tried = look(detector, views, tried.errors + step)
        best = tried if best is None else max(best, tried, key=rank)
    assert best is not None
    return best


def rank(tried: Tried) -> float:
    """How good a correction is: clues that agree count, balls of the right size count more, and errors that the clues
    still see count against it."""
    left = float(np.abs(tried.step[:HEIGHT]).max())
    return tried.gain + _BALLS_COUNT * tried.ball_gain - _LEFT_COUNTS * math.log1p(left / math.radians(1.0))


def look(detector: Detector, views: Sequence[View], errors: Floats) -> Tried:
    """Detect in frames with poses without these errors (ERRORS,)."""
    clues = []
    for each in views:
        try:
            detections = detector.detect(each.image, corrected(each.orientation, errors), each.lens)
        except GeometryError:  # too low for the object
            continue
        clues.append(clues_of(detections))
    step = np.zeros(ERRORS)
    for _ in range(_SOLUTIONS):
        found = sum((evidence_of(each, step) for each in clues), NOTHING)
        step, deviations = solved(found)
    own = np.zeros(ERRORS)
    own[WIDTH] = found.vector[WIDTH] / (found.information[WIDTH, WIDTH] + EXPECTED[WIDTH] ** -2)
    if deviations[HEIGHT] > _SCALED:
        step[HEIGHT] = 0.0
    gain = sum(evidence_of(each, own).gain for each in clues)
    ball_gain = sum(of_balls(each.balls, own).gain for each in clues)
    return Tried(errors, step, deviations, gain, ball_gain, round(found.balls), round(found.lines))
