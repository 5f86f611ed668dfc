"""What a frame says about small errors of the camera's pose.

With a wrong pose, things on the plane have wrong forms. Balls look too large or too small, mostly far away; lines that
are parallel or at right angles are not; one line is wider than another. Each such clue is linear in small errors:

- A pitch that is larger by d moves the place (x, y) on the plane by -(x^2 + h^2, x y) d / h, with the height h and x
  ahead; a roll that is larger by e moves it by (x y, y^2 + h^2) e / h; a height that is larger by the share s by
  (x, y) s. Derivatives of these shifts turn and widen lines.
- The distance of a ball follows from its direction and the pose, and another one from its size.

A frame is then a term of a linear least-squares problem, and terms of frames add up (detection/pose_check.py).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Floats

ERRORS = 4
"""Unknown numbers: true minus assumed pitch and roll [rad], logarithms of true over assumed height, and of the lines'
width over LINE_WIDTH."""

PITCH, ROLL, HEIGHT, WIDTH = range(ERRORS)

LINE_WIDTH = 0.075
"""A usual width of lines [m]; leagues have 0.05 to 0.125."""

EXPECTED = np.array([0.35, 0.35, 0.7, 0.32])
"""Standard deviations of the errors before the first frame."""

_SIZE_NOISE, _SIZE_PIXELS = 0.07, 0.7
"""Standard deviations of the logarithm of a ball's size, and of its radius [px]."""

_DIRECTION_PIXELS = 1.0
"""Standard deviation of a ball's direction [px]."""

_TURN_NOISE = 0.012
"""Standard deviation of a line's direction [rad], in addition to what its ridge says: fields are painted by hand."""

_SEEN = 0.75
"""Share of a line's turn that is seen: lines are found near two directions at a right angle."""

_WIDTH_NOISE = 0.12
"""Standard deviation of the logarithm of a line's width."""

_SIZE_SPAN, _WIDTH_SPAN = 1.5, 2.0
"""Spans of the logarithms of sizes and widths by chance."""

_TAIL = 3.0
"""A clue that is farther off than so many standard deviations counts less and less."""

_SHORTEST = 0.5
"""Shorter pieces of lines [m] are no clues."""


class Evidence(NamedTuple):
    """A term of the least-squares problem: the sum of |J e - r|^2 over all clues, for errors e (ERRORS,).

    information (ERRORS, ERRORS): sum of J^T J. vector (ERRORS,): sum of J^T r. gain: logarithm of how much more likely
    the clues are with these errors than by chance. balls, lines: numbers of clues.
    """

    information: Floats
    vector: Floats
    gain: float = 0.0
    balls: float = 0.0
    lines: float = 0.0

    def scaled(self, kept: float, worth: float) -> Evidence:
        """The share `kept` of the clues, each of which counts `worth` times as much."""
        each = kept * worth
        return Evidence(
            self.information * each, self.vector * each, self.gain * each, self.balls * kept, self.lines * kept
        )

    def __add__(self, other: tuple[object, ...]) -> Evidence:
        assert isinstance(other, Evidence)
        return Evidence(
            self.information + other.information,
            self.vector + other.vector,
            self.gain + other.gain,
            self.balls + other.balls,
            self.lines + other.lines,
        )


NOTHING = Evidence(np.zeros((ERRORS, ERRORS)), np.zeros(ERRORS))


class LineClues(NamedTuple):
    """Lines in the level frame: x ahead of the camera, origin below it.

    ends (m, 2, 2) [m]. turn_errors (m,) [rad]: standard deviations of their directions. widths (m,) [m]: NaN where
    unknown. See Ridges.measured.
    """

    ends: Floats
    turn_errors: Floats
    widths: Floats


NO_LINES = LineClues(np.empty((0, 2, 2)), np.empty(0), np.empty(0))


class BallClues(NamedTuple):
    """Balls in the level frame.

    bearings (n, 3). ratios (n,): apparent over expected size. pixels (n,): radii [px]. confidences (n,). lift: height
    of the camera over the plane, over that of the camera over the balls' centers. pixel: angle of a pixel [rad].
    """

    bearings: Floats
    ratios: Floats
    pixels: Floats
    confidences: Floats
    lift: float
    pixel: float


class Clues(NamedTuple):
    """All clues of a frame. height: assumed height of the camera [m]."""

    lines: LineClues
    balls: BallClues
    height: float


def evidence_of(clues: Clues, errors: Floats) -> Evidence:
    """The evidence of a frame. errors (ERRORS,): as they are known so far, which tells outliers."""
    return of_balls(clues.balls, errors) + of_lines(clues.lines, clues.height, errors)


def solved(evidence: Evidence) -> tuple[Floats, Floats]:
    """The most likely errors (ERRORS,), and their standard deviations (ERRORS,)."""
    covariance = np.linalg.inv(evidence.information + np.diag(EXPECTED**-2))
    return covariance @ evidence.vector, np.sqrt(np.diag(covariance))


def of_balls(balls: BallClues, errors: Floats) -> Evidence:
    """The evidence of balls: log(distance by the pose) + J e = log(distance by the size)."""
    if not len(balls.ratios):
        return NOTHING
    x, y, z = balls.bearings.T
    down = np.maximum(-z, 1e-3)
    zero = np.zeros(len(x))
    slopes = np.array([-x / down, y / down, zero + balls.lift, zero])
    level = np.hypot(x, y) / down
    noise = np.hypot(_SIZE_NOISE, np.hypot(_SIZE_PIXELS / balls.pixels, _DIRECTION_PIXELS * balls.pixel * level))
    found = _summed(slopes, -np.log(balls.ratios), noise, errors, balls.confidences, _SIZE_SPAN)
    return found._replace(balls=len(x))


def of_lines(lines: LineClues, height: float, errors: Floats) -> Evidence:
    """The evidence of lines, which are parallel or at right angles, and equally wide."""
    ends, turn_errors, widths = lines
    along = ends[:, 1] - ends[:, 0]
    lengths = np.hypot(along[:, 0], along[:, 1])
    kept = lengths > _SHORTEST
    if not kept.any():
        return NOTHING
    x, y = 0.5 * (ends[kept, 0] + ends[kept, 1]).T / height
    c, s = (along[kept] / lengths[kept, None]).T
    zero = np.zeros(len(x))
    # How the direction turns [rad], and how the width grows, with each error.
    turns = _SEEN * np.array([x * s * c - y * c * c, y * s * c - x * s * s, zero, zero])
    grows = np.array([y * s * c - x * (1.0 + s * s), y * (1.0 + c * c) - x * s * c, zero + 1.0, zero - 1.0])
    noise = np.hypot(turn_errors[kept], _TURN_NOISE)
    angles = np.arctan2(s, c)
    precision = 1.0 / (noise * noise)
    # All lines are parallel or at right angles to a direction that is not known; the expected one first, then the rest.
    main = 0.25 * np.angle((precision * np.exp(4j * (angles + errors @ turns))).sum())
    off = -np.remainder(angles - main + 0.25 * np.pi, 0.5 * np.pi) + 0.25 * np.pi
    found = _without_mean(turns, off, noise, errors)
    wide = np.flatnonzero(np.isfinite(widths[kept]))
    if len(wide):
        measured = np.log(widths[kept][wide] / LINE_WIDTH)
        found += _summed(
            grows[:, wide], -measured, np.full(len(wide), _WIDTH_NOISE), errors, np.ones(len(wide)), _WIDTH_SPAN
        )
    return found._replace(lines=len(x))


def _without_mean(slopes: Floats, rest: Floats, noise: Floats, errors: Floats) -> Evidence:
    """The evidence of clues that have an unknown constant in common."""
    weights = _weights(slopes, rest, noise, errors)
    share = weights / max(float(weights.sum()), 1e-12)
    slopes = slopes - (slopes @ share)[:, None]
    rest = rest - rest @ share
    weighted = slopes * weights
    gain = _gain(rest - errors @ slopes, noise, 0.5 * np.pi)
    return Evidence(weighted @ slopes.T, weighted @ rest, float(gain.sum()))


def _summed(slopes: Floats, rest: Floats, noise: Floats, errors: Floats, shares: Floats, span: float) -> Evidence:
    """The evidence of clues with slopes J (ERRORS, n), residuals (n,) and standard deviations (n,). shares (n,): how
    much each counts. span: of residuals by chance."""
    weighted = slopes * (_weights(slopes, rest, noise, errors) * shares)
    gain = _gain(rest - errors @ slopes, noise, span) @ shares
    return Evidence(weighted @ slopes.T, weighted @ rest, float(gain))


def _gain(rest: Floats, noise: Floats, span: float) -> Floats:
    """Logarithms (n,) of how much more likely residuals (n,) are than by chance; at least -1."""
    return np.asarray(np.maximum(np.log(span / (2.5 * noise)) - 0.5 * np.log1p((rest / noise) ** 2), -1.0))


def _weights(slopes: Floats, rest: Floats, noise: Floats, errors: Floats) -> Floats:
    """Precisions (n,) of clues; less for those far off, as with Cauchy's distribution."""
    off = (rest - errors @ slopes) / (_TAIL * noise)
    return np.asarray(1.0 / (noise * noise * (1.0 + off * off)))
