"""Candidates: each cluster of likely points may be an object.

The paper suggests two uses of the mesh after the network (section "Discussion and Conclusion"): the graph diameter of
a cluster shows whether it can be an object, and the best fitting subgraph shows where. This module does the first,
`fitting.py` the second.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats, Mask, Singles
from .clustering import clusters, wider_than
from .observation import Observation
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
    it. near (p,): slots of the points up to three object radii around the cluster. probabilities, log_odds (p,): of
    these points. reason: why it is not an object, or None if it is not rejected so far.
    """

    class_name: str
    center: Floats
    near: Chosen
    probabilities: Floats
    log_odds: Floats
    reason: str | None = None


def propose(observation: Observation, class_name: str, probabilities: Singles, settings: Settings) -> list[Candidate]:
    """Candidates of one class from the slots' probabilities (m,), largest cluster first.

    A cluster with the wrong size for its place is a candidate with a reason.
    """
    likely = _on_screen(observation, probabilities > settings.threshold)
    if not len(likely):
        return []
    candidates = []
    for cluster in clusters(observation.layout, likely)[:_MOST_CLUSTERS]:
        center = _middle(observation, cluster)
        near = _around(observation, cluster, center)
        p = probabilities[near].astype(np.float64)
        log_odds = np.log(np.maximum(p, 1e-12) / np.maximum(1.0 - p, 1e-12)).clip(-_MOST_LOG_ODDS, _MOST_LOG_ODDS)
        reason = _wrong_size(observation, cluster, center, near, settings)
        candidates.append(Candidate(class_name, center, near, p, log_odds, reason))
    return candidates


def _on_screen(observation: Observation, chosen: Mask) -> Chosen:
    """The chosen slots (m,) that are on screen, in the order of the mesh.

    In this order, sums over them have the same digits for every layout.
    """
    members = np.flatnonzero(chosen & observation.projected.on_screen)
    return members[np.argsort(observation.layout.slots[members])]


def _middle(observation: Observation, cluster: Chosen) -> Floats:
    """Center (3,) [m] of an object in the direction of a cluster's mean ray."""
    view = observation.view
    axis = view.layout.rays[cluster].mean(axis=0, keepdims=True)
    return np.asarray(view.shape.center_along(axis / np.linalg.norm(axis), view.height)[0])


def _around(observation: Observation, cluster: Chosen, center: Floats) -> Chosen:
    """All points on screen that are at most three object radii farther from `center` than the cluster's farthest."""
    rays, radius = observation.layout.rays, observation.view.shape.radius
    distance = float(np.linalg.norm(center))
    cosines = along(rays, center / distance)
    # Between unit vectors at an angle a, the chord is as long as sqrt(2 - 2 cos a).
    chord = math.sqrt(2.0 * max(1.0 - float(cosines[cluster].min()), 0.0)) + 3.0 * radius / distance
    return _on_screen(observation, cosines > 1.0 - 0.5 * min(chord, 2.0) ** 2)


def _wrong_size(
    observation: Observation, cluster: Chosen, center: Floats, near: Chosen, settings: Settings
) -> str | None:
    """Why a cluster around `center` has too few points or a too large graph diameter for an object, or None.

    It rejects things of the wrong size, as in the paper's fig:ball_detection_images_3.
    """
    view = observation.view
    rays = view.layout.rays
    expected = int((view.shape.offset(rays[near], center[None], view.height) < 1.0).sum())
    # A filled object has more than half of its points in its cluster. A quarter is enough, because `center` may be off.
    if len(cluster) < 0.25 * expected:
        return f"{len(cluster)} points, where an object there has {expected}"
    widest = math.ceil(settings.max_widths * view.rings)
    middle = int(np.argmax(rays[cluster] @ center))
    if wider_than(view.layout, cluster, middle, widest):
        return f"wider than {widest} steps in the mesh, where an object is {view.rings:.1f} wide"
    return None
