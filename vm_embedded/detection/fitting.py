"""Where an object fits a candidate best: the paper's best fitting subgraph (section "Discussion and Conclusion")."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Floats
from ..geometry.shape import tangents
from .candidates import Candidate
from .prepared_view import PreparedView

_GRID = np.stack(np.meshgrid(np.linspace(-1.0, 1.0, 5), np.linspace(-1.0, 1.0, 5)), axis=2).reshape(-1, 2)
"""Places of one round of the search for a center, in units of the round's reach."""

_REACHES = (1.0, 0.3, 0.1)
"""Reach of each round, in object radii; along the vertical in half heights if the object is taller than wide."""

_SCALES = np.geomspace(0.6, 1.8, 15)
"""Apparent sizes to try, as shares of the expected one."""


def fit(view: PreparedView, candidate: Candidate) -> Candidate:
    """The candidate with the center [m] of the object whose subgraph fits best.

    If points were independent, the likeliest object would have the largest sum of log-odds inside its outline. The
    search takes the best of a grid of places, then of finer grids around it. Points near the outline count
    in part, so the sum changes smoothly with the center. Points off screen add nothing, so an object that the border
    cuts gets its true center.
    """
    center = candidate.center
    rays = np.ascontiguousarray(candidate.rays)
    for reach in _REACHES:
        distance = float(np.linalg.norm(center))
        axis = center / distance
        across, up = view.shape.radius, view.shape.half_size
        tried = axis + reach / distance * ((_GRID * (across, up)) @ tangents(axis))
        centers = view.shape.center_along(tried, view.height)  # which takes rays of any length
        inside = _share_inside(view.shape.offset(rays, centers, view.height), view)
        center = centers[int(np.argmax(inside @ candidate.log_odds))]
    return replace(candidate, center=center)


def best_scale(view: PreparedView, candidate: Candidate, offset: Floats) -> float:
    """The apparent size that fits best at the candidate's bearing, as a share of the one that the plane predicts.

    The paper identifies objects by their scale (fig:ball_detection_images_3). This function rejects
    nothing: detections only report the scale, as `angular_radius`, `distance_by_angle` and `distances_agree`.

    offset (p,): of the candidate's points from its center, as `Shape.offset` gives it.
    """
    sums = _share_inside(offset / _SCALES[:, None], view) @ candidate.log_odds
    return float(_SCALES[int(np.argmax(sums))])


def _share_inside(offset: Floats, view: PreparedView) -> Floats:
    """1 for points inside the outline, 0 outside.

    It falls from a quarter of a ring spacing inside of the outline to a quarter outside. offset: from the center, 1 on
    the outline, as `Shape.offset` gives it, or 1 on another outline that is tried. The ring spacing is that of the
    expected size.
    """
    return np.clip(0.5 + (1.0 - offset) / (0.5 * view.ring_spacing), 0.0, 1.0)
