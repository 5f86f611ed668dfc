"""Neighbors farther away, for dilated convolutions.

A convolution with dilation d takes the points d steps away from a point instead of its neighbors, which are one step
away. So a network sees more of a picture with the same number of weights and look-ups. Dilations are usual in networks
for pictures; the paper has none.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..arrays import Indices
from .mesh import SELF, Groups


def distinct_dilations(dilations: Iterable[int]) -> tuple[int, ...]:
    """The different ones of some dilations, and 1, in ascending order: the order of `with_dilations`."""
    return tuple(sorted({1, *dilations}))


def with_dilations(neighbors: Indices, groups: Groups, dilations: Sequence[int]) -> Indices:
    """Neighbors (n + 1, D N) for D dilations: N for the first one, then N for the second one, and so on.

    neighbors: (n + 1, N) of a mesh. groups: MeshModel.groups.
    """
    if tuple(dilations) == (1,):
        return neighbors
    return np.concatenate([dilated(neighbors, groups, each) for each in dilations], axis=1)


def dilated(neighbors: Indices, groups: Groups, dilation: int) -> Indices:
    """The points (n + 1, N) that take the place of the neighbors (n + 1, N) in a convolution with a dilation.

    A group's members lie in the row that is `dilation` rows above or below the point, or in its own one. There, they
    are `dilation` steps apart, so the layout `runs` finds them at a fixed distance in memory. A point that is only
    reached by way of missing neighbors is missing.
    """
    if dilation == 1:
        return neighbors
    itself = np.arange(len(neighbors), dtype=np.int32)
    left, right = neighbors[:, groups[0][0]], neighbors[:, groups[0][-1]]
    found = np.empty_like(neighbors)
    for group in groups:
        middle = itself
        if SELF not in group:
            # Of two members, one is half a step to the left and one half a step to the right: taken in turn, they lead
            # straight on.
            ways = group[1:2] if len(group) == 3 else group
            middle = _walk(itself, [neighbors[:, ways[step % len(ways)]] for step in range(dilation)])
        for member, offset in zip(group, _offsets(group, dilation), strict=True):
            if member != SELF:
                found[:, member] = _walk(middle, [left if offset < 0 else right] * abs(offset))
    return found


def links_across(groups: Groups, dilation: int) -> int:
    """How many links lead to the farthest of the points of `dilated`, at most."""
    if dilation == 1:
        return 1
    return max((SELF not in group) * dilation + max(map(abs, _offsets(group, dilation))) for group in groups)


def _offsets(group: Sequence[int], dilation: int) -> list[int]:
    """Steps along a row, from the middle of a group's members to each of them; to the left they are negative."""
    return {1: [0], 2: [-(dilation // 2), dilation - dilation // 2], 3: [-dilation, 0, dilation]}[len(group)]


def _walk(places: Indices, ways: Sequence[Indices]) -> Indices:
    """The points that these ways (n + 1,), taken one after the other, lead to from points (m,)."""
    for way in ways:
        places = np.take(way, places)
    return places
