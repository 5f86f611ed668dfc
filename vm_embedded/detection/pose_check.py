"""Is the camera's pose right? The clues of many frames together tell.

Each frame whose picture is new adds its evidence (field/pose_evidence.py). Older evidence slowly counts less. The sum
says how far pitch, roll and height are off, and how sure that is.
"""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np

from ..arrays import Floats, Image
from ..field.pose_evidence import (
    ERRORS,
    EXPECTED,
    HEIGHT,
    NO_LINES,
    NOTHING,
    PITCH,
    BallClues,
    Clues,
    Evidence,
    LineClues,
    evidence_of,
    solved,
)
from ..geometry.orientation import Orientation
from .above_horizon import field_above_horizon
from .detections import Detections
from .pose_state import PoseState
from .prepared_view import PreparedView

_KEPT = 1.0 - 1.0 / 300.0
"""Share of the evidence that a further frame leaves: about that of the last 300 frames counts."""

_WORTH = 0.25
"""What a frame's evidence counts: its clues have errors in common, and it resembles other frames."""

_KNOWN = np.array([math.radians(1.5), math.radians(1.5), 0.08])
"""Standard deviations below which errors of pitch, roll and height are known."""

_DOUBTFUL = np.array([math.radians(1.2), math.radians(1.2), 0.045])
_WRONG = np.array([math.radians(2.5), math.radians(2.5), 0.12])
"""Errors of pitch, roll and height that a right pose may have, because clues share errors. Those for doubts come from
half of the recordings of benchmarks/pose_check.py, and from real frames, whose poses are right to about a degree."""

_RIGHT = np.array([math.radians(2.2), math.radians(2.2), math.inf])
"""Errors of pitch and roll that must be ruled out for a right pose."""

_DOUBT_AT, _WRONG_AT = np.array([2.0, 2.0, 0.5]), 3.0
"""Standard deviations by which an error must be larger. Balls of a recording share most of their errors."""

_RATE = 0.05
"""Share of the known errors by which a picture changes the correction."""

_FARTHEST = np.array([math.radians(3.0), math.radians(3.0), math.log(1.1)])
"""Largest correction."""

_SMALLEST = 3.0
"""Least radius of an object whose size is a clue [px]."""

_FIELD_ABOVE = math.radians(3.5)
"""Mean angle above the horizon up to which pictures look like the field, from which the pose is doubtful."""

_FEWEST_ABOVE = 3
"""Pictures that are needed for this."""

_THUMBNAIL = (20, 16)
_CHANGED = 0.12
"""Mean change of a thumbnail from which a picture is new, as a share of its contrast."""


class PoseCheck:
    """Collects evidence about the pose of a camera.

        check = PoseCheck()
        for image in frames:
            detections = check.update(detector.detect(image, orientation, lens))
            print(detections.pose.verdict)

    every: a picture is looked at only if so many frames have passed: those of a fast camera are much alike, and the
    check would take a few percent of the time. A robot's poses change; the check finds what they have in common: errors
    of the mount, the joints or the lens.

    corrects: `corrected` slowly takes such errors out of poses; detect with these then.
    """

    def __init__(self, every: int = 1, corrects: bool = False) -> None:
        self._corrects, self._correction = corrects, np.zeros(HEIGHT + 1)
        self._every, self._since = every, every
        self.evidence = NOTHING
        self._frames = 0.0
        self._above = self._looked = 0.0  # sum of angles of field above the horizon [rad], and pictures looked at
        self._thumbnail: Image | None = None
        self.errors: Floats = np.zeros(ERRORS)
        self.deviations: Floats = EXPECTED
        self._state = PoseState(verdict="unknown")

    def update(self, detections: Detections) -> Detections:
        """The same detections with what they and those before say about the pose."""
        if detections.manifest.look is None:  # its sizes are as coarse as its mesh
            return detections
        self._since += 1
        if self._since >= self._every and self._is_new(detections):
            self._since = 0
            if self.deviations[PITCH] > _KNOWN[PITCH]:
                self._look_above(detections)
            self.add(evidence_of(clues_of(detections), self.errors))
        return replace(detections, pose=self._state)

    def _look_above(self, detections: Detections) -> None:
        names = [each.name for each in detections.manifest.classes]
        angle = field_above_horizon(detections.observation, names.index("field")) if "field" in names else None
        if angle is not None:
            self._above, self._looked = self._above * _KEPT + angle, self._looked * _KEPT + 1.0

    def add(self, found: Evidence) -> None:
        """Add the evidence of a frame."""
        self.evidence = self.evidence.scaled(_KEPT, 1.0) + found.scaled(1.0, _WORTH)
        self._frames = self._frames * _KEPT + 1.0
        self.errors, self.deviations = solved(self.evidence)
        if self._corrects:
            self._correct()
        self._state = self._judged()

    def corrected(self, orientation: Orientation) -> Orientation:
        """A pose with the correction so far."""
        if not self._correction.any():
            return orientation
        pitch, roll, height = self._correction.tolist()
        return orientation.adjusted(pitch, roll, math.exp(height))

    def _correct(self) -> None:
        """Correct by a small share of the errors that are known. The evidence so far then speaks for smaller errors."""
        known = self.deviations[: HEIGHT + 1] < _KNOWN
        new = np.clip(self._correction + _RATE * known * self.errors[: HEIGHT + 1], -_FARTHEST, _FARTHEST)
        moved = np.append(new - self._correction, 0.0)
        self._correction = new
        self.evidence = self.evidence._replace(vector=self.evidence.vector - self.evidence.information @ moved)
        self.errors = solved(self.evidence)[0]

    @property
    def field_above(self) -> float:
        """The angle above the horizon up to which pictures look like the field [rad]; 0 if it is small."""
        mean = self._above / max(self._looked, 1.0)
        return mean if self._looked >= _FEWEST_ABOVE - 0.5 and mean > _FIELD_ABOVE else 0.0

    @property
    def state(self) -> PoseState:
        """What the frames so far say."""
        return self._state

    def _judged(self) -> PoseState:
        errors, deviations = self.errors[:3], self.deviations[:3]
        sizes = np.abs(errors)
        known = deviations < _KNOWN
        certain = np.where(known, _DOUBT_AT, _WRONG_AT)
        if (sizes - _WRONG_AT * deviations > _WRONG).any():
            verdict = "wrong"
        elif (sizes - certain * deviations > _DOUBTFUL).any() or (not known[PITCH] and self.field_above):
            verdict = "doubtful"
        else:
            is_right = (sizes + _WRONG_AT * deviations < _RIGHT)[:HEIGHT].all()
            verdict = "consistent" if is_right else "unknown"
        pitch, roll, height = (
            float(value) if is_known or abs(value) > _WRONG_AT * deviation else None
            for value, is_known, deviation in zip(errors, known, deviations, strict=True)
        )
        return PoseState(
            verdict=verdict,
            pitch=None if pitch is None else math.degrees(pitch),
            roll=None if roll is None else math.degrees(roll),
            height=None if height is None else 100.0 * math.expm1(height),
            frames=round(self._frames),
            balls=round(self.evidence.balls),
            lines=round(self.evidence.lines),
            **self._added(),
        )

    def _added(self) -> dict[str, float]:
        if not self._corrects:
            return {}
        pitch, roll, height = self._correction.tolist()
        return {
            "added_pitch": math.degrees(pitch),
            "added_roll": math.degrees(roll),
            "added_height": 100.0 * math.expm1(height),
        }

    def _is_new(self, detections: Detections) -> bool:
        """Whether a picture differs from the last one that counted: a camera that stands still learns nothing more."""
        picture = detections.observation.pyramid.level(2)
        thumbnail = np.asarray(cv2.resize(picture, _THUMBNAIL, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        last = self._thumbnail
        if last is not None and last.shape == thumbnail.shape:
            contrast = 2.0 + cv2.meanStdDev(thumbnail)[1].mean()
            if cv2.norm(thumbnail, last, cv2.NORM_L1) < _CHANGED * contrast * thumbnail.size:
                return False
        self._thumbnail = thumbnail
        return True


def clues_of(detections: Detections) -> Clues:
    """What a frame shows that tells about the pose."""
    view = detections.observation.view
    back = _to_level(view)
    ridges = None if detections.field is None else detections.field.ridges
    lines = NO_LINES
    if ridges is not None:
        ends, turn_errors, widths = ridges.measured()
        lines = LineClues(ends @ back.T, turn_errors, widths)
    large = [each for each in detections if each.radius > _SMALLEST]
    bearings = np.array([each.bearing for each in large]).reshape(-1, 3)
    bearings[:, :2] = bearings[:, :2] @ back.T
    balls = BallClues(
        bearings,
        np.array([each.distance / each.distance_by_angle for each in large]),
        np.array([each.radius for each in large]),
        np.array([each.confidence for each in large]),
        view.height / (view.height - view.shape.center_height),
        1.0 / view.lens.scale,
    )
    return Clues(lines, balls, view.height)


def _to_level(view: PreparedView) -> Floats:
    """The rotation (2, 2) from the plane's frame to the one whose x axis is ahead of the camera."""
    ahead = view.heading @ view.rotation[:, 0]
    if math.hypot(ahead[0], ahead[1]) < 1e-9:  # it looks straight down: ahead is the picture's upward direction
        ahead = -(view.heading @ view.rotation[:, 2]) * ahead[2]
    x, y = ahead[:2] / math.hypot(ahead[0], ahead[1])
    return np.array([[x, y], [-y, x]])
