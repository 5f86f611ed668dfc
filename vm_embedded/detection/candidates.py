"""Candidates: each cluster of likely points may be an object.

The paper suggests two uses of the mesh after the network (section "Discussion and Conclusion"): the graph diameter of
a cluster shows whether it can be an object, and the best fitting subgraph shows where. This module does the first,
`objects.py` the second.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats, Singles
from ..mesh.mesh import Mesh
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


_Edges = tuple[Chosen, Chosen]


def clusters(mesh: Mesh, members: Chosen) -> list[Chosen]:
    """The connected components of the points `members`, largest first. Points keep their order.

    Two points are connected if either is a neighbor of the other. In each round the smallest label spreads along all
    links at once, then each point takes the label of its label. So the number of rounds grows with the logarithm of a
    component's width, without a loop over points.
    """
    a, b = _edges(mesh, members)
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


def graph_diameter(mesh: Mesh, members: Chosen, limit: int) -> int:
    """Steps between the two members farthest apart, on ways through members only; at most limit + 1.

    Two breadth-first sweeps, the second from the end of the first: exact for chains, at most a step or two short for
    round clusters.
    """
    edges = _edges(mesh, members)
    far = int(np.argmax(_steps(edges, len(members), 0, limit)))
    return int(_steps(edges, len(members), far, limit).max())


def wider_than(mesh: Mesh, members: Chosen, middle: int, limit: int) -> bool:
    """Whether the graph diameter of `members` is above `limit`.

    One sweep from the member in the `middle` usually decides: no two members are farther apart than twice its reach.
    """
    reach = int(_steps(_edges(mesh, members), len(members), middle, limit).max())
    return 2 * reach > limit and graph_diameter(mesh, members, limit) > limit


def _edges(mesh: Mesh, members: Chosen) -> _Edges:
    """Links between members, as positions in `members`, in both directions."""
    position = np.full(len(mesh) + 1, -1)
    position[members] = np.arange(len(members))
    links = np.take(mesh.neighbors, members, axis=0)
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
