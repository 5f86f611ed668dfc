"""A Kalman filter for a place on a plane that moves with constant velocity.

A state (4,) is x, y [m] and the velocity in x and y [m/s]; it has a covariance (4, 4).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Floats


def predict(state: Floats, covariance: Floats, elapsed: float, wander: float) -> tuple[Floats, Floats]:
    """State and covariance after a time [s].

    The velocity changes by independent random steps (white noise of the acceleration), in a second by `wander` [m/s].
    """
    move, noise = np.eye(4), np.zeros((4, 4))
    for axis in (0, 1):
        move[axis, axis + 2] = elapsed
        noise[axis::2, axis::2] = ((elapsed**3 / 3.0, elapsed**2 / 2.0), (elapsed**2 / 2.0, elapsed))
    return move @ state, move @ covariance @ move.T + wander**2 * noise


def squared_distances(state: Floats, covariance: Floats, places: Floats, errors: Floats) -> tuple[Floats, Floats]:
    """How far m measured places (m, 2) with covariances (m, 2, 2) are from a predicted state.

    Returns squared Mahalanobis distances (m,), which have the chi-squared distribution with two degrees of freedom for
    the right object, and twice the negative logarithms (m,) of the likelihoods, but for a constant.
    """
    off = places - state[:2]
    spread = covariance[:2, :2] + errors
    squares = (off[:, None] @ np.linalg.solve(spread, off[..., None])).reshape(-1)
    return squares, squares + np.log(np.linalg.det(spread))


def correct(state: Floats, covariance: Floats, place: Floats, error: Floats) -> tuple[Floats, Floats]:
    """State and covariance after a measurement of the place (2,) with a covariance (2, 2)."""
    gain = np.linalg.solve(covariance[:2, :2] + error, covariance[:2]).T
    rest = np.eye(4)
    rest[:, :2] -= gain
    # Joseph's form stays symmetric and positive.
    return state + gain @ (place - state[:2]), rest @ covariance @ rest.T + gain @ error @ gain.T
