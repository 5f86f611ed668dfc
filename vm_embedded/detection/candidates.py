"""Candidates: each cluster of likely points may be an object.

The paper suggests two uses of the mesh after the network (section "Discussion and Conclusion"): the graph diameter of
a cluster shows whether it can be an object, and the best fitting subgraph shows where. This module does the first,
`objects.py` the second.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats, Mask, Singles
from ..mesh.mesh import PointGraph
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


_Edges = tuple[Chosen, Chosen]


def clusters(graph: PointGraph, members: Chosen) -> list[Chosen]:
    """The connected components of the points `members`, largest first. Points keep their order.

    Two points are connected if either is a neighbor of the other. In each round the smallest label spreads along all
    links at once, then each point takes the label of its label. So the number of rounds grows with the logarithm of a
    component's width, without a loop over points.
    """
    a, b = _edges(graph, members)
    label = np.arange(len(members))
    while True:
        spread = label.copy()
        np.minimum.at(spread, label[a], label[b])
        spread = spread[spread]
        if np.array_equal(spread, label):
            break
        label = spread
    order = np.argsort(label, kind="stable")
    starts = np.flatnonzero(np.diff(label[order], prepend=-1))
    parts = np.split(members[order], starts[1:]) if len(members) else []
    return sorted(parts, key=len, reverse=True)


def graph_diameter(graph: PointGraph, members: Chosen, limit: int) -> int:
    """Steps between the two members farthest apart, on ways through members only; at most limit + 1.

    Two breadth-first sweeps, the second from the end of the first: exact for chains, at most a step or two short for
    round clusters.
    """
    edges = _edges(graph, members)
    far = int(np.argmax(_steps(edges, len(members), 0, limit)))
    return int(_steps(edges, len(members), far, limit).max())


def wider_than(graph: PointGraph, members: Chosen, middle: int, limit: int) -> bool:
    """Whether the graph diameter of `members` is above `limit`.

    One sweep from the member in the `middle` usually decides: no two members are farther apart than twice its reach.
    """
    reach = int(_steps(_edges(graph, members), len(members), middle, limit).max())
    return 2 * reach > limit and graph_diameter(graph, members, limit) > limit


def _edges(graph: PointGraph, members: Chosen) -> _Edges:
    """Links between members, as positions in `members`, in both directions."""
    position = np.full(len(graph) + 1, -1)
    position[members] = np.arange(len(members))
    links = graph.links(members)
    ends = position[links].ravel()
    linked = np.flatnonzero(ends >= 0)
    starts, ends = linked // links.shape[1], ends[linked]
    return np.concatenate([starts, ends]), np.concatenate([ends, starts])


def _steps(edges: _Edges, count: int, start: int, limit: int) -> Chosen:
    """Steps (count,) from `start`; -1 for members more than limit + 1 steps away."""
    a, b = edges
    steps = np.full(count, -1)
    steps[start] = 0
    for step in range(1, limit + 2):
        reached = b[steps[a] == step - 1]
        fresh = reached[steps[reached] < 0]
        if len(fresh) == 0:
            break
        steps[fresh] = step
    return steps
