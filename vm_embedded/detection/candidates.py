"""Candidates: each cluster of likely points may be an object.

The paper suggests two uses of the mesh after the network (section "Discussion and Conclusion"): the graph diameter of
a cluster shows whether it can be an object, and the best fitting subgraph shows where. This module does the first,
`fitting.py` the second.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats, Singles
from .clustering import clusters, wider_than
from .observation import Observation
from .prepared_view import PreparedView
from .projection import along
from .settings import Settings

_MOST_CLUSTERS = 100
"""Largest number of candidates of a class: a frame of noise must not cost a second."""

_MOST_LOG_ODDS = 4.0
"""Limit of a point's log-odds: no single point may outvote its neighbors."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A cluster that may be an object of a class.

    center (3,): of the object, relative to the camera in the mesh frame [m]; the cluster's middle until `fit` improves
    it. rays (p, 3), probabilities, log_odds (p,): of the points up to three object radii around the cluster. reason:
    why it is not an object, or None if it is not rejected so far.
    """

    class_name: str
    center: Floats
    rays: Floats
    probabilities: Floats
    log_odds: Floats
    reason: str | None = None


def propose(observation: Observation, class_name: str, probabilities: Singles, settings: Settings) -> list[Candidate]:
    """Candidates of one class from the points' probabilities (n,), largest cluster first.

    A cluster with the wrong size for its place is a candidate with a reason.
    """
    mesh, rays, numbers = observation.view.mesh, observation.mesh_rays, observation.projected.answered
    candidates = []
    for cluster in clusters(mesh, numbers[probabilities > settings.threshold])[:_MOST_CLUSTERS]:
        center = _middle(observation.view, cluster)
        near = _around(observation.view, cluster, center, rays)
        around = rays[near]
        p = probabilities[near].astype(np.float64)
        log_odds = np.log(np.maximum(p, 1e-12) / np.maximum(1.0 - p, 1e-12)).clip(-_MOST_LOG_ODDS, _MOST_LOG_ODDS)
        reason = _wrong_size(observation.view, cluster, center, around, settings)
        candidates.append(Candidate(class_name, center, around, p, log_odds, reason))
    return candidates


def _middle(view: PreparedView, cluster: Chosen) -> Floats:
    """Center (3,) [m] of an object in the direction of the mean ray of a cluster's points of the mesh."""
    axis = view.mesh.rays[cluster].mean(axis=0, keepdims=True)
    return np.asarray(view.shape.center_along(axis / np.linalg.norm(axis), view.height)[0])


def _around(view: PreparedView, cluster: Chosen, center: Floats, rays: Floats) -> Chosen:
    """The rays (n, 3) that are at most three object radii farther from `center` than the cluster's farthest."""
    distance = float(np.linalg.norm(center))
    nearest = float(along(view.mesh.rays[cluster], center / distance).min())
    # Between unit vectors at an angle a, the chord is as long as sqrt(2 - 2 cos a).
    chord = math.sqrt(2.0 * max(1.0 - nearest, 0.0)) + 3.0 * view.shape.radius / distance
    return np.flatnonzero(along(rays, center / distance) > 1.0 - 0.5 * min(chord, 2.0) ** 2)


def _wrong_size(view: PreparedView, cluster: Chosen, center: Floats, near: Floats, settings: Settings) -> str | None:
    """Why a cluster around `center` has too few points or a too large graph diameter for an object, or None.

    near (p, 3): rays to the points around. It rejects things of the wrong size, as in the paper's
    fig:ball_detection_images_3.
    """
    expected = int((view.shape.offset(near, center[None], view.height) < 1.0).sum())
    # A filled object has more than half of its points in its cluster. A quarter is enough, because `center` may be off.
    if len(cluster) < 0.25 * expected:
        return f"{len(cluster)} points, where an object there has {expected}"
    widest = math.ceil(settings.max_widths * view.rings)
    middle = int(np.argmax(view.mesh.rays[cluster] @ center))
    if wider_than(view.mesh, cluster, middle, widest):
        return f"wider than {widest} steps in the mesh, where an object is {view.rings:.1f} wide"
    return None
