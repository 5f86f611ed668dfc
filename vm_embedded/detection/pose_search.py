"""Search for the pose with which frames look like a field.

Evidence (field/pose_evidence.py) is linear: it holds for small errors only. So the search detects again with each
better pose, as in the method of Gauss and Newton, and from several pitches and heights. The pose counts with which the
clues agree best.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import AnyImage, Floats
from ..errors import GeometryError, InputError
from ..field.pose_evidence import ERRORS, EXPECTED, HEIGHT, LINE_WIDTH, NOTHING, WIDTH, evidence_of, of_balls, solved
from ..geometry.lens import Lens
from ..geometry.orientation import Orientation
from .detector import Detector
from .pose_check import clues_of
from .pose_state import PoseState

PITCHES = np.radians([0.0, 8.0, -8.0, 17.0, -17.0, 28.0]).tolist()
"""Errors of the pitch that are tried."""

HEIGHTS = np.log([1.0, 0.7, 1.4, 0.5, 2.0, 0.35, 2.8]).tolist()
"""Errors of the height that are tried."""

_FEW_HEIGHTS = np.log([1.0, 0.7, 1.4, 0.5, 2.0]).tolist()
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

SURE_BALLS = 2.0
"""Gain of balls from which they tell the height."""

_MORE_BALLS = 4.0
"""Gain of balls that alone shows a better pose: lines may be many at a wrong height."""

_CLEARLY = 1.25
"""Factor by which another height must be better."""

_OFF, _OFF_HEIGHT = math.radians(2.5), 0.12
"""Least errors of a pose that is wrong."""

_SCALED = 0.15
"""Standard deviation of the height from which it is not known at all: then only balls of other heights tell."""

_KNOWN_WIDTH = 0.05
"""Standard deviation of the logarithm of a known width of lines."""


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

    @property
    def rank(self) -> float:
        """How good a correction is: clues that agree count, balls of the right size count more, and errors that the
        clues still see count against it."""
        left = float(np.abs(self.step[:HEIGHT]).max())
        return self.gain + _BALLS_COUNT * self.ball_gain - _LEFT_COUNTS * math.log1p(left / math.radians(1.0))

    @property
    def total(self) -> Floats:
        """The correction (ERRORS,) with the step."""
        return self.errors + np.clip(self.step, -_LARGEST, _LARGEST)


def corrected(orientation: Orientation, errors: Floats) -> Orientation:
    """The orientation without these errors (ERRORS,)."""
    pitch, roll, height = errors[:WIDTH].tolist()
    return orientation.adjusted(pitch, roll, math.exp(height))


class PoseSearch:
    """Frames, and a detector that looks at them with corrected poses. line_width [m]: of the lines, if it is known."""

    def __init__(self, detector: Detector, views: Sequence[View], line_width: float | None = None) -> None:
        self._detector, self._views = detector, views
        self._widths = 1.0 if line_width is None else LINE_WIDTH / line_width
        known = np.zeros(ERRORS) if line_width is None else _one(WIDTH, _KNOWN_WIDTH**-2)
        self._nothing = NOTHING._replace(information=np.diag(known))

    def found(self, pitches: Sequence[float] = PITCHES, heights: Sequence[float] = _FEW_HEIGHTS) -> tuple[Tried, Tried]:
        """The poses as they are, and without their errors. pitches [rad], heights: errors to start from."""
        given = self.look(np.zeros(ERRORS))
        some = self._views[:: -(-len(self._views) // _SOME_VIEWS)]
        starts = [self.look(np.array([pitch, 0.0, height, 0.0]), some) for height in heights for pitch in pitches]
        starts.sort(key=lambda each: each.rank, reverse=True)
        most_balls = max(each.ball_gain for each in starts)
        if not starts[0].errors.any() and starts[0].ball_gain >= most_balls:  # the given poses: none is better
            return given, given
        best = given
        for each in starts[:_REFINED]:
            if each.gain > _LEAST:
                best = max(best, self.refined(each), key=lambda each: each.rank)
        if best is given:
            return given, given
        return given, self.refined(self._scaled(best))

    def _scaled(self, best: Tried) -> Tried:
        """A correction with the height that balls speak for; without balls, with the given one: lines fit at any."""
        angles = best.errors.copy()
        angles[HEIGHT] = 0.0
        unscaled = self.look(angles)
        others = [best, *(self.look(best.errors + _one(HEIGHT, each)) for each in HEIGHTS if each)]
        scaled = max(others, key=lambda each: each.ball_gain)
        is_clear = scaled.ball_gain > max(SURE_BALLS, _CLEARLY * unscaled.ball_gain + 1.0)
        return scaled if is_clear else unscaled

    def refined(self, tried: Tried) -> Tried:
        """The best correction near one that was tried."""
        best: Tried | None = None
        for _ in range(_STEPS):
            step = tried.total - tried.errors
            if best is not None and (np.abs(step) < _CLOSE).all():
                break
            tried = self.look(tried.errors + step)
            best = tried if best is None else max(best, tried, key=lambda each: each.rank)
        assert best is not None
        return best

    def look(self, errors: Floats, views: Sequence[View] | None = None) -> Tried:
        """Detect in frames with poses without these errors (ERRORS,). views: some of the frames; default: all."""
        clues = []
        for each in self._views if views is None else views:
            try:
                detections = self._detector.detect(each.image, corrected(each.orientation, errors), each.lens)
            except GeometryError:  # too low for the object
                continue
            found = clues_of(detections)
            clues.append(found._replace(lines=found.lines._replace(widths=found.lines.widths * self._widths)))
        step = np.zeros(ERRORS)
        for _ in range(_SOLUTIONS):
            evidence = sum((evidence_of(each, step) for each in clues), self._nothing)
            step, deviations = solved(evidence)
        width = evidence.vector[WIDTH] / (evidence.information[WIDTH, WIDTH] + EXPECTED[WIDTH] ** -2)
        if deviations[HEIGHT] > _SCALED:
            step[HEIGHT] = 0.0
        gain = sum(evidence_of(each, _one(WIDTH, width)).gain for each in clues)
        ball_gain = sum(of_balls(each.balls, np.zeros(ERRORS)).gain for each in clues)
        return Tried(errors, step, deviations, gain, ball_gain, round(evidence.balls), round(evidence.lines))


def with_search(state: PoseState, detector: Detector, views: Sequence[View]) -> PoseState:
    """What frames say, with what a search adds to it: errors that are too large for the evidence of small ones."""
    is_consistent = state.verdict == "consistent"
    if is_consistent and state.height is not None:
        return state
    search = PoseSearch(_with_lines(detector), views)
    given, found = search.found([0.0], HEIGHTS) if is_consistent else search.found()
    pitch, roll, height = found.total[:WIDTH].tolist()
    has_scale = found.ball_gain > max(SURE_BALLS, given.ball_gain + 1.0)
    is_off = max(abs(pitch), abs(roll)) > _OFF or (has_scale and abs(height) > _OFF_HEIGHT)
    more_balls = found.ball_gain > given.ball_gain * _CLEARLY + _MORE_BALLS
    if not is_off or not (more_balls or found.gain > given.gain * _BETTER + _SURE):
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


def _with_lines(detector: Detector) -> Detector:
    """A detector that also sees lines, if the package has one for the same balls; otherwise the same."""
    classes = {each.name for each in detector.manifest.classes}
    if "line" in classes or "ball" not in classes:
        return detector
    with suppress(InputError):  # a robot may lack it
        settings = replace(detector.settings, object_radius=detector.shape.radius, field_features=True)
        return Detector.from_file("soccer", settings)
    return detector


def _one(which: int, size: float) -> Floats:
    """Errors (ERRORS,) of which one is not 0."""
    errors = np.zeros(ERRORS)
    errors[which] = size
    return errors
