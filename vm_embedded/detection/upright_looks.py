"""The close look at things that stand on the plane: goal posts and robots.

The look at objects serves here, too. The object is a circle on the plane, around the base of the upright. So a patch
shows the base in its middle, the ground around it, and the lower part of the upright.

A point of an upright is seen against the plane behind the base. So in each direction, only the nearest points of the
class propose a place: the nearest of all, and those of the more probable ones.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Singles
from ..field.uprights import Base, apart
from ..geometry.shapes import Circle
from .looking import Look, look_closely
from .observation import Observation, Stopwatch
from .settings import Settings

_COLUMN = 0.012
"""Width of a direction [rad]."""

_JUMP = 0.12
"""Points farther than the nearest one of their direction by more than this share are above the base."""

_LEVELS = (0.1, 0.3, 0.6, 0.9)
"""Probabilities at which points are sought again, so that a less probable point in front does not hide a base."""


def around_bases(observation: Observation, radius: float) -> Observation:
    """The same points, where circles on the plane with this radius [m] are sought: one around each base."""
    return replace(observation, view=observation.view._replace(shape=Circle(radius)))


def nearest_points(observation: Observation, probabilities: Singles, above: float) -> Singles:
    """Probabilities (m,) of the slots that may be at a base, 0 for the others.

    In each direction, these are the nearest points whose probability is above a limit, for each of several limits.
    probabilities (m,): of a class. above: the lowest limit.
    """
    rays, found = observation.layout.rays, np.zeros_like(probabilities)
    likely = np.flatnonzero(observation.projected.on_screen & (probabilities > above) & (rays[:, 2] < 0.0))
    if not len(likely):
        return found
    x, y, z = rays[likely].T
    columns = np.floor(np.arctan2(y, x) / _COLUMN).astype(np.intp)
    columns -= columns.min()
    ranges, p = np.hypot(x, y) / -z, probabilities[likely]
    is_low = np.zeros(len(likely), dtype=np.bool_)
    for level in (above, *_LEVELS):
        reaches = p > level
        nearest = np.full(columns.max() + 1, np.inf)
        np.minimum.at(nearest, columns[reaches], ranges[reaches])
        is_low |= reaches & (ranges <= (1.0 + _JUMP) * nearest[columns])
    found[likely[is_low]] = p[is_low]
    return found


def find_bases(observation: Observation, look: Look, settings: Settings) -> list[Base]:
    """The uprights of a look's class, nearest first. Raises ModelError if the look network does not run.

    settings: `min_confidence` and `max_proposals` count.
    """
    contract = look.contract
    probabilities = observation.slot_probabilities[:, observation.manifest.column(contract.object_class)]
    if contract.object_class not in observation.manifest.peaks:
        probabilities = nearest_points(observation, probabilities, contract.above)
    circles = around_bases(observation, contract.upright_radius)
    judged = look_closely(circles, look, probabilities, settings, Stopwatch())
    heading = observation.view.heading[:2]
    width = 2.0 * contract.upright_radius
    found = [Base(heading @ each.center, width * each.scale, each.confidence) for each in judged]
    return apart(found)
