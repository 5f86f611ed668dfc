"""Robust least squares over numbers that all groups of measurements share, and numbers of each group.

All fits of this program have this form: the lens is shared and each frame has its board's pose; or the camera's pose is
shared and each ball or board has its place on the floor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats, Indices
from vm_embedded.cli.progress import ProgressBar

Residuals = Callable[[Floats, Floats], Floats]
"""Residuals (N,) [px] of shared numbers (p,) and of each group's own numbers (g, q)."""

_STEP = 1e-6
"""Step of the numeric derivatives; all numbers are scaled so that about 1 is a large change."""

_MOST_STEPS = 200

_WORST = 1e4
"""Replaces residuals that are not finite or larger [px], so that a wrong step is expensive and not an error."""


@dataclass(frozen=True, eq=False)
class SharedFit:
    """The result of a fit.

    shared (p,) and own (g, q): the fitted numbers. covariance (p, p): of the shared numbers, infinite in all that the
    measurements do not determine. residuals (N,) [px]. noise: estimated standard deviation of one residual [px].
    """

    shared: Floats
    own: Floats
    covariance: Floats
    residuals: Floats
    noise: float

    def deviations(self) -> Floats:
        """Standard deviations (p,) of the shared numbers."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def fit_shared(
    residuals: Residuals,
    groups: Indices,
    shared: Floats,
    own: Floats,
    outlier: float,
    assumed: tuple[float, int] = (0.0, 0),
) -> SharedFit:
    """Fit from a start with shared numbers (p,) and own ones (g, q).

    groups (N,): the group of each residual. outlier [px]: residuals beyond it count less than quadratically. assumed: a
    noise [px] expected beforehand, and the number of residuals that this expectation is worth.
    """
    from scipy.optimize import least_squares  # here: scipy takes a second to import, and --help does not need it

    count, width = len(shared), own.shape[1]

    def split(numbers: Floats) -> tuple[Floats, Floats]:
        return numbers[:count], numbers[count:].reshape(own.shape)

    def value(numbers: Floats) -> Floats:
        found = residuals(*split(numbers))
        return np.asarray(np.where(np.isfinite(found), np.clip(found, -_WORST, _WORST), _WORST))

    bar = ProgressBar(_MOST_STEPS, "vm-calibrate", unit="steps")
    bar.note = "most fits need far fewer steps"

    def jacobian(numbers: Floats) -> Floats:
        bar.advance()
        return _jacobian(value, numbers, groups, count, width)

    start = np.concatenate([shared, own.ravel()])
    try:
        found = least_squares(
            value, start, jacobian, loss="soft_l1", f_scale=outlier, x_scale="jac", max_nfev=_MOST_STEPS
        )
    finally:
        bar.clear()
    spare = len(groups) - len(start)
    power, weight = assumed
    noise = np.sqrt((2.0 * found.cost + power**2 * weight) / max(spare + weight, 1))
    best_shared, best_own = split(found.x)
    return SharedFit(
        best_shared, best_own, noise**2 * _inverse(found.jac)[:count, :count], value(found.x), float(noise)
    )


def _jacobian(value: Callable[[Floats], Floats], at: Floats, groups: Indices, count: int, width: int) -> Floats:
    """Derivatives (N, p) of the residuals by `count` shared numbers and, behind them, `width` numbers of each group."""
    matrix = np.zeros((len(groups), len(at)))
    for column in range(count):
        matrix[:, column] = _slope(value, at, slice(column, column + 1))
    # A group's own numbers change only its own residuals, so one evaluation moves those of all groups at once.
    for column in range(width):
        slope = _slope(value, at, slice(count + column, None, width))
        matrix[np.arange(len(groups)), count + column + width * groups] = slope
    return matrix


def _slope(value: Callable[[Floats], Floats], at: Floats, columns: slice) -> Floats:
    """Central difference of the residuals (N,), with all `columns` of the numbers moved together."""
    ends = []
    for step in (_STEP, -_STEP):
        moved = at.copy()
        moved[columns] += step
        ends.append(value(moved))
    return np.asarray((ends[0] - ends[1]) / (2.0 * _STEP))


def _inverse(jacobian: Floats) -> Floats:
    """The inverse of J^T J, with infinite variances for numbers that the residuals do not determine."""
    lengths = np.linalg.norm(jacobian, axis=0)
    scale = np.where(lengths > 0.0, lengths, 1.0)
    _, singular, turned = np.linalg.svd(jacobian / scale, full_matrices=False)
    solid = singular > 1e-7 * singular[0]
    inverse = (turned[solid].T / singular[solid] ** 2) @ turned[solid]
    loose = (np.abs(turned[~solid]) > 1e-3).any(axis=0)
    inverse[loose, loose] = np.inf
    return np.asarray(inverse / scale[:, None] / scale)
