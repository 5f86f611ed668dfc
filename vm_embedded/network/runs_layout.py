"""The layout `runs`: points in an order in which a point's neighbors lie beside each other in memory.

The words that this file uses:

- A *slot* is one of the m places in the network's input `points` (3, m). It holds a point, a copy of a point, or
  nothing. An empty slot is a *gap* and has the off-screen point's value in every layer.
- A *run* is a sequence of slots in which each point is followed by its right neighbor. A gap follows the last one.
- A *group* is up to three neighbors of a point that should follow each other in a run (MeshModel.groups). The groups
  of ring6 are left, the point itself and right; top left and top right; bottom left and bottom right. The first group
  of every mesh is left, itself and right: it says which points a run joins. For a certain point, the *members* of a
  group are the up to three points that are these neighbors of it.
- The *middle* of a group is the second slot of a group of three, and the first slot of a shorter group.
- A layer's *table* (vm_export/runs_graph.py) holds, for each group, m - 1 weighted sums over windows of three adjacent
  slots; slots outside of the group have the weight 0. So a point looks up one sum for each group, not one value for
  each neighbor. There are m - 1 sums, not m, because runs_graph.py then cuts all windows out of one row of values
  by a single reshape.
- A *column* is the position of a sum in the table. Within a group, column s + 1 is the window around slot s. The first
  two columns of each group are not used, and the last two slots, which are gaps, have no window.

An example. Points 0 1 2 are a part of a ring, points 3 4 5 6 the whole next ring. The groups are left, self and right,
and two upper neighbors: 3 4 above point 0, 4 5 above point 1, 6 3 above point 2. The m = 23 slots are:

    slot   0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22
    point  - - - 0 1 2 - 3 4 5 6  -  -  5  6  3  6  3  4  6  3  -  -

Slots 3 to 5 and 7 to 10 are runs; - is a gap. The ring closes between 6 and 3, and the runs tear the members
of three groups apart there: the upper neighbors 6 3 of point 2, and 5 6 3 and 6 3 4 around points 6 and 3. Copies of
these members follow.

Point 1 is in slot 4. Its first group, 0 1 2, has its middle in slot 4, and its second group, 4 5, in slot 8. Each group
has m - 1 = 22 columns of the table. Column j of a group holds the sum over the slots j - 2, j - 1 and j, so the sum
around slot s is in column s + 1. The columns of point 1 are 4 + 1 = 5 and 22 + 8 + 1 = 31.

A copy looks up the same sums as its original, and a gap the same sums as the off-screen point. So both keep the right
values in all layers, without masks or special cases.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import Indices, Mask, Singles, frozen
from ..mesh.mesh import SELF, Groups, Mesh
from .layout import OFF_SCREEN, Feeds, WholeLayout, rays_in

_GAP = 1
"""The middle one of the three gaps that come first. All slots around it are gaps, as around the off-screen point."""

_GAPS_BEFORE = 3
_GAPS_BEHIND = 2
"""Each group has m - 1 columns, and column j is the window around slot j - 1. So the slots m - 2 and m - 1 have no
window."""

_Positions = npt.NDArray[np.int64]


class RunsLayout(WholeLayout):
    """The slots of a mesh in the layout `runs`, and the columns in which each slot finds the sums of its groups.

    columns: (G, m) positions in a layer's table of G (m - 1) sums.
    """

    def __init__(self, mesh: Mesh, groups: Groups) -> None:
        self._groups = groups
        slots, places, middles = _arranged(mesh.neighbors, self._groups)
        count = len(slots)
        self.slots = frozen(slots.astype(np.int32))
        self.places = frozen(places.astype(np.int32))
        original = np.zeros(count, dtype=bool)
        original[places] = True
        self.original = frozen(original)
        self.rays = rays_in(mesh, slots)
        # Of each group: the column of the sum around slot 0.
        self._first_columns = 1 + (count - 1) * np.arange(len(middles), dtype=np.int32)[:, None]
        self.columns = frozen(middles.astype(np.int32) + self._first_columns)

    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        """See Layout. members: slots; here these are not the members of a group."""
        places = np.append(self.places, np.int32(len(self)))  # with m for the off-screen point
        neighbors = sum(map(len, self._groups)) - 1  # in all groups together, one member is the point itself
        found = np.empty((len(members), neighbors), dtype=np.int32)
        for group, columns, first in zip(self._groups, self.columns, self._first_columns, strict=True):
            middle = columns[members] - first
            for offset, neighbor in zip(group_offsets(group), group, strict=True):
                if neighbor != SELF:
                    found[:, neighbor] = places[self.slots[middle + offset]]
        return found

    @property
    def nbytes(self) -> int:
        return super().nbytes + self.columns.nbytes

    def feeds(self, colors: Singles, on_screen: Mask) -> Feeds:
        columns = self.columns.astype(np.int64)
        np.copyto(columns, _GAP + self._first_columns, where=~on_screen)
        return {"points": np.where(on_screen, colors, OFF_SCREEN), "columns": columns}

    def probabilities(self, output: Singles) -> Singles:
        return output.T


def group_offsets(group: tuple[int, ...]) -> range:
    """Slots of a group's members relative to its middle: -1, 0, 1 for three members, 0, 1 for two, 0 for one."""
    first = -(len(group) // 3)
    return range(first, first + len(group))


def _arranged(neighbors: Indices, groups: Groups) -> tuple[_Positions, _Positions, _Positions]:
    """Arranges a mesh's points in slots, from their neighbors (n + 1, N).

    Returns three arrays: the point in each slot (m,), n in gaps; the slot of each point (n,); and middles (G, m): for
    the point in each slot, the slot of the middle of each of its groups, _GAP in gaps.
    """
    n = len(neighbors) - 1
    # A second gap at the end. If the last point is the left one of a group of three, `_found_in_runs` reads the two
    # slots after it.
    runs = np.append(_in_runs(neighbors[:n, groups[0][0]], neighbors[:n, groups[0][-1]]), n)
    slot_of = np.full(n + 1, _GAP)  # each point, and the off-screen point
    filled = np.flatnonzero(runs < n)
    slot_of[runs[filled]] = filled

    parts, middles, count = [runs], [], len(runs)
    for group in groups:
        members: npt.NDArray[np.integer] = np.stack(
            [np.arange(n) if each == SELF else neighbors[:n, each] for each in group]
        )
        middle, torn = _found_in_runs(members, group_offsets(group), runs, slot_of)
        copies, copy_of = np.unique(members[:, torn], axis=1, return_inverse=True)
        # The copy of a torn group begins at slot count + len(group) * its copy's number. Its middle is one slot later
        # in a group of three, whose first offset is -1; it is the same slot in a shorter group.
        middle[:n][torn] = count + len(group) * copy_of.reshape(-1) - group_offsets(group)[0]
        parts.append(copies.T.reshape(-1))
        count += copies.size
        middles.append(middle)
    point_at = np.concatenate([*parts, np.full(_GAPS_BEHIND, n)])
    return point_at, slot_of[:n], np.stack([middle[point_at] for middle in middles])


def _found_in_runs(
    members: npt.NDArray[np.integer], offsets: range, runs: _Positions, slot_of: _Positions
) -> tuple[_Positions, Mask]:
    """Where the group of each point lies in the runs, and whether the runs tear it apart.

    members: (group size, n) the points in the group of each point; the number n stands for a missing one. runs: the
    point in each slot. slot_of: (n + 1,) the slot of each point. Returns the slots of the groups' middles (n + 1,),
    _GAP where all members are missing, and a mask (n,) of the groups that are torn.
    """
    n = members.shape[1]
    middle = np.full(n + 1, _GAP)
    # If the group is whole, each member that is not missing leads to the same middle.
    for offset, points in zip(offsets, members, strict=True):
        np.copyto(middle[:n], slot_of[points] - offset, where=points < n)
    # The place of a missing member must be a gap. A group with another point there is torn, too.
    torn = np.zeros(n, dtype=bool)
    for offset, points in zip(offsets, members, strict=True):
        torn |= runs[middle[:n] + offset] != points
    return middle, torn


def _in_runs(left: Indices, right: Indices) -> _Positions:
    """The point in each slot of the runs; n in gaps. Three gaps come first, and one gap follows each run.

    left, right: neighbors (n,) of each point. Two points are *linked* if they are each other's right and left neighbor.
    A *piece* is a sequence of points i, i + 1, ... each linked to the next. numpy finds all pieces at once, and a loop
    only joins pieces to runs. For example, a view shows the first three and the last three points of a ring: two
    pieces. The ring's last point is linked to its first, so the two pieces become one run.
    """
    n = len(left)
    points = np.arange(n)
    # A piece starts at i unless i - 1 and i are linked. The cuts [:n] and [: len(starts)] are for n = 0: without points
    # there are no pieces.
    starts = np.flatnonzero(np.append(True, (right[:-1] != points[1:]) | (left[1:] != points[:-1]))[:n])
    ends = np.append(starts[1:], n)[: len(starts)] - 1
    piece_at = np.full(n + 1, -1)  # the piece that starts with a point; none starts with a missing neighbor, n
    piece_at[starts] = np.arange(len(starts))
    follower = piece_at[right[ends]]
    # The follower must be linked back. A piece without a follower (-1) reads the last piece here, and stays at -1.
    follower[left[starts[follower]] != ends] = -1

    order, ends_run = _chained(follower)
    lengths = (ends - starts + 1)[order]
    # The first slot of each piece; the last entry is the number of slots. One gap follows each piece that ends a run.
    first_slot = _GAPS_BEFORE + np.cumsum(np.append(0, lengths + ends_run))
    runs = np.full(first_slot[-1], n)
    within = np.arange(n) - np.repeat(np.cumsum(lengths) - lengths, lengths)  # place of a point in its piece
    runs[np.repeat(first_slot[:-1], lengths) + within] = np.repeat(starts[order], lengths) + within
    return runs


def _chained(follower: _Positions) -> tuple[npt.NDArray[np.intp], Mask]:
    """All pieces in an order in which each piece comes right before its follower, and which of them end a run.

    follower: (pieces,) the piece that continues a piece, or -1.
    """
    leads = np.ones(len(follower), dtype=bool)
    leads[follower[follower >= 0]] = False
    order: list[int] = []
    ends_run: list[bool] = []
    waiting = np.ones(len(follower), dtype=bool)
    # First the pieces that follow no other; the rest are closed rings, which may begin with any piece.
    for first in (*np.flatnonzero(leads).tolist(), *np.flatnonzero(~leads).tolist()):
        if not waiting[first]:
            continue
        piece = first
        while piece >= 0 and waiting[piece]:
            waiting[piece] = False
            order.append(piece)
            ends_run.append(False)
            piece = int(follower[piece])
        ends_run[-1] = True
    return np.array(order, dtype=np.intp), np.array(ends_run, dtype=bool)
