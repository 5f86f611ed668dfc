"""Clusters of points that the mesh connects, and their graph diameter (paper, "Discussion and Conclusion")."""

from __future__ import annotations

import numpy as np

from ..arrays import Chosen
from ..mesh.mesh import Mesh

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
