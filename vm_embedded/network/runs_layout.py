"""Points as columns, such that neighbors which follow each other in a mesh follow each other in memory."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import Indices, Mask, Singles, frozen
from ..mesh.mesh import SELF, Mesh, Runs
from .layout import OFF_SCREEN, Feeds, Layout

GAP = 1
"""The middle one of three gaps that come first: all around it is off screen, so it is what the off-screen point is."""

_GAPS_BEHIND = 2
"""The last two slots are in no window's middle: the windows end with the network's third copy of the points, which
lacks three (vm_export/runs_graph.py)."""


class RunsLayout(Layout):
    """Points as columns, such that neighbors which follow each other in a ring follow each other in memory.

    The neighbors of a point form groups (MeshModel.runs) of up to three that follow each other. So a group's part of a
    convolution is one of width 3 along memory, and a point needs one look-up for each group, not for each neighbor.

    The slots are the points, each followed by its right neighbor or, where that is off screen, by a gap, which stands
    for the off-screen point. Behind them come copies of the groups that are torn apart there, where a ring closes and
    around the nadir. Each slot, copies and gaps too, looks up what its point would, so all copies of a point keep its
    value through all layers.

    An example, with - for gaps: points 4 5 6 of a ring and 7 8 9 10 of the next one lie as - - - 4 5 6 - 7 8 9 10 -,
    and if point 6 has 10 and 7 as its upper pair, a copy of the two follows.

    columns: (G, m), where slot s finds its group g in a layer's table (G (m - 1),). The sum around slot s stands in
    column s + 1 of its group, because that is how the network gets a window of width 3 without moving data.
    """

    def __init__(self, mesh: Mesh, groups: Runs) -> None:
        self._groups = groups
        slots, places, middles = _runs(mesh.neighbors, self._groups)
        count = len(slots)
        self.slots = frozen(slots.astype(np.int32))
        self.places = frozen(places.astype(np.int32))
        original = np.zeros(count, dtype=bool)
        original[places] = True
        self.original = frozen(original)
        self.rays = frozen(np.take(np.append(mesh.rays.T, np.full((3, 1), np.nan), axis=1), slots, axis=1)).T
        self._starts = 1 + (count - 1) * np.arange(len(middles), dtype=np.int32)[:, None]
        self.columns = frozen(middles.astype(np.int32) + self._starts)

    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        places = np.append(self.places, np.int32(len(self)))
        found = np.empty((len(members), sum(map(len, self._groups)) - 1), dtype=np.int32)
        for group, columns, start in zip(self._groups, self.columns, self._starts, strict=True):
            middle = columns[members] - start
            for offset, neighbor in enumerate(group, start=-(len(group) // 3)):
                if neighbor != SELF:
                    found[:, neighbor] = places[self.slots[middle + offset]]
        return found

    @property
    def nbytes(self) -> int:
        return super().nbytes + self.columns.nbytes

    def points(self) -> Singles:
        return np.empty((3, len(self)), dtype=np.float32)

    def colors(self, points: Singles) -> Singles:
        return points.T

    def feeds(self, points: Singles, on_screen: Mask) -> Feeds:
        off_screen = ~on_screen
        np.copyto(points, OFF_SCREEN, where=off_screen)
        columns = self.columns.astype(np.int64)
        np.copyto(columns, GAP + self._starts, where=off_screen)
        return {"points": points, "columns": columns}

    def answers(self, output: Singles) -> Singles:
        return output.T


_Positions = npt.NDArray[np.int64]


def _runs(neighbors: Indices, groups: Runs) -> tuple[_Positions, _Positions, _Positions]:
    """The point of each slot (m,), n for gaps; the slot of each point (n,); and for each group of the slots' points,
    the slot in its middle (G, m)."""
    n = len(neighbors) - 1
    # One gap more at the end: a group of three may begin with the last point.
    slots = np.append(_in_runs(neighbors[:n, groups[0][0]], neighbors[:n, groups[0][-1]]), n)
    slot = np.full(n + 1, GAP)
    shown = np.flatnonzero(slots < n)
    slot[slots[shown]] = shown

    points = np.arange(n)
    parts, middles, count = [slots], [], len(slots)
    for group in groups:
        wanted = np.stack([points if each == SELF else neighbors[:n, each] for each in group])
        center = len(group) // 3  # of three the second is the middle of the window, of two and of one the first
        middle = np.full(n + 1, GAP)  # where any of them is on screen, the others should lie beside it
        for offset, targets in enumerate(wanted, start=-center):
            np.copyto(middle[:n], slot[targets] - offset, where=targets < n)
        torn = np.zeros(n, dtype=bool)
        for offset, targets in enumerate(wanted, start=-center):
            torn |= slots[middle[:n] + offset] != targets
        copies, which = np.unique(wanted[:, torn], axis=1, return_inverse=True)
        middle[:n][torn] = count + len(group) * which.reshape(-1) + center
        parts.append(copies.T.reshape(-1))
        count += copies.size
        middles.append(middle)
    slots = np.concatenate([*parts, np.full(_GAPS_BEHIND, n)])
    return slots, slot[:n], np.stack([middle[slots] for middle in middles])


def _in_runs(left: Indices, right: Indices) -> _Positions:
    """Points of slots, n in gaps: three gaps, then the n points, each followed by its right neighbor or by a gap.

    Points in a row are joined at once; the loop is over the pieces, two for a ring that the view cuts in two.
    """
    n = len(left)
    points = np.arange(n)
    starts = np.flatnonzero(np.append(True, (right[:-1] != points[1:]) | (left[1:] != points[:-1]))[:n])
    ends = np.append(starts[1:], n)[: len(starts)] - 1
    piece = np.full(n + 1, -1)
    piece[starts] = np.arange(len(starts))
    follower = piece[right[ends]]  # the piece that begins with the right neighbor of a piece's end
    follower[left[starts[follower]] != ends] = -1
    leads = np.ones(len(starts), dtype=bool)
    leads[follower[follower >= 0]] = False

    order: list[int] = []
    gaps_after: list[int] = []
    waiting = np.ones(len(starts), dtype=bool)
    for first in (*np.flatnonzero(leads).tolist(), *np.flatnonzero(~leads).tolist()):  # the latter close in a circle
        each = first
        while each >= 0 and waiting[each]:
            waiting[each] = False
            order.append(each)
            gaps_after.append(0)
            each = int(follower[each])
        if gaps_after:
            gaps_after[-1] = 1
    ordered = starts[np.array(order, dtype=np.intp)]
    lengths = (ends - starts + 1)[np.array(order, dtype=np.intp)]
    place = 3 + np.cumsum(np.append(0, lengths + np.array(gaps_after, dtype=np.intp)))
    slots = np.full(place[-1], n)
    within = points - np.repeat(np.cumsum(lengths) - lengths, lengths)
    slots[np.repeat(place[:-1], lengths) + within] = np.repeat(ordered, lengths) + within
    return slots
