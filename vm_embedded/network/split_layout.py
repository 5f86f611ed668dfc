"""Computes sectors of a mesh at the same time, one on each core.

A network of L convolutions gives a point an answer that depends on points at most L links away (the paper's section
"Network Architecture"). So a sector also gets the points that are at most L links outside of it. The answers of
these copies are wrong, and the runtime ignores them. So no sector needs an answer of another one.

Threads inside of ONNX Runtime gain less: it splits each operator, waits for all threads after each one, and does not
split the look-ups.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..arrays import Chosen, Indices, Mask, Singles, frozen
from ..mesh.mesh import Mesh
from .layout import Layout, Run, WholeLayout


class Sector(NamedTuple):
    """Points of a mesh, in ascending order: those that belong to a sector, and these with their surroundings."""

    own: Chosen
    members: Chosen


class SplitLayout(Layout):
    """The slots of all sectors, one sector after the other.

    sectors: all points of the mesh, each in one of them. arrange: gives the mesh of a sector its layout. others: runs
    all sectors but the first one, which the caller runs itself.
    """

    def __init__(
        self, mesh: Mesh, sectors: Sequence[Sector], arrange: Callable[[Mesh], WholeLayout], others: Executor
    ) -> None:
        self._others = others
        self._neighbors = mesh.neighbors
        self._parts: list[tuple[WholeLayout, slice]] = []
        slots, original, begin = [], [], 0
        places = np.empty(len(mesh), dtype=np.int32)
        for own, members in sectors:
            layout = arrange(mesh.part(members))
            is_own = np.isin(members, own)
            places[members[is_own]] = begin + layout.places[is_own]
            slots.append(np.append(members, len(mesh))[layout.slots])
            original.append(layout.original & np.append(is_own, False)[layout.slots])
            self._parts.append((layout, slice(begin, begin + len(layout))))
            begin += len(layout)
        self.places = frozen(places)
        self.slots = frozen(np.concatenate(slots).astype(np.int32))
        self.original = frozen(np.concatenate(original))
        self.rays = frozen(np.concatenate([layout.rays.T for layout, _ in self._parts], axis=1)).T

    def links(self, members: npt.NDArray[np.integer]) -> Indices:
        places = np.append(self.places, np.int32(len(self)))
        return np.asarray(places[self._neighbors[self.slots[members]]], dtype=np.int32)

    @property
    def nbytes(self) -> int:
        return super().nbytes + self._neighbors.nbytes + sum(layout.nbytes for layout, _ in self._parts)

    def answers(self, network: Run, colors: Singles, on_screen: Mask) -> Singles:
        def answer(layout: WholeLayout, place: slice) -> Singles:
            return layout.answers(network, colors[:, place], on_screen[place])

        waiting = [self._others.submit(answer, *part) for part in self._parts[1:]]
        found = [answer(*self._parts[0]), *(each.result() for each in waiting)]
        return np.concatenate([each.T for each in found], axis=1).T  # class by class, as they lie in memory


def sectors_of(mesh: Mesh, count: int, depth: int) -> list[Sector]:
    """A mesh in `count` sectors of equal size, by the bearings of its points from their middle.

    depth: links that an answer depends on, L.
    """
    x, y = mesh.rays[:, 0], mesh.rays[:, 1]
    middle = np.arctan2(y.sum(), x.sum())
    # The angle from -pi to pi begins behind the camera, so that a view ahead is cut once for two sectors.
    bearing = np.remainder(np.arctan2(y, x) - middle + np.pi, 2.0 * np.pi)
    owned = [np.sort(each) for each in np.array_split(np.argsort(bearing, kind="stable"), count)]
    return [Sector(own, with_surroundings(mesh, own, depth)) for own in owned]


def with_surroundings(mesh: Mesh, own: Chosen, depth: int) -> Chosen:
    """Points (k,) of a mesh, in ascending order, and all points that are at most `depth` links away from them."""
    reached: Mask = np.zeros(len(mesh) + 1, dtype=bool)
    reached[own] = True
    edge = own
    for _ in range(depth):
        beyond = np.zeros(len(mesh) + 1, dtype=bool)
        beyond[mesh.neighbors[edge]] = True
        beyond[-1] = False
        edge = np.flatnonzero(beyond & ~reached)
        if not len(edge):
            break
        reached[edge] = True
    return np.flatnonzero(reached[:-1])
