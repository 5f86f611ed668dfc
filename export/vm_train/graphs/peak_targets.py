"""What a network on strips learns about places of objects: peaks of a score, and the way from a cell to the place.

The score follows the center networks (X. Zhou and others, 2019, "Objects as Points"): 1 in the cell that has the place
in it, and beside it a bell curve within which a high score is a small error only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vm_embedded.arrays import Floats, Indices, Mask, Singles
from vm_embedded.mesh.grids import STEPS
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.network.manifest import Manifest

from ..data.classes import Labels
from .true_places import TruePlace

_BELL = 0.9
"""Standard deviation of the bell curve [cells]."""

_NEAR = 1.5
"""Distance from a place within which cells learn the way to it [cells]. Around a place that is hidden, cells within
this distance learn nothing."""

_RIGHT, _LEFT, _UP, _DOWN = (STEPS[8].index(each) for each in ((1, 0), (-1, 0), (0, 1), (0, -1)))


class PeakTargets(NamedTuple):
    """What n cells learn about P classes with peaks.

    score (n, P): 1 for the cell of an object, below 1 around it, 0 elsewhere. counts (n, P): whether the cell learns
    the score. way (n, P, 3): right and up to the object [cells], and the logarithm of its relative width. near (n, P):
    whether the cell learns the way.
    """

    score: Singles
    counts: Mask
    way: Singles
    near: Mask


def in_cells(places: Sequence[TruePlace], rays: Floats, mesh: Mesh, manifest: Manifest) -> Singles:
    """Rows (o, 5) for places with rays (o, 3) in the mesh frame: the number of the class, column and row, the logarithm
    of the width over the diameter of the mesh's object, and 1 if it is shown, 0 if hidden, or -1 if the places of the
    class are unknown.

    A place is in the strip where the nearest point is no context. Places outside of all strips are left out.
    """
    assert mesh.cells is not None
    assert mesh.margin is not None
    core = np.flatnonzero(~mesh.margin)
    found = []
    for each, ray in zip(places, rays, strict=True):
        if each.shown is None:
            found.append((each.number, 0.0, 0.0, 0.0, -1.0))
        elif len(core) and np.isfinite(ray).all():
            nearest = core[int(np.argmax(mesh.rays[core] @ ray))]
            column, row = _way(mesh, nearest, ray)
            if max(abs(column), abs(row)) <= _NEAR:
                x, y = mesh.cells[nearest].tolist()
                size = np.log(each.width / (2.0 * manifest.radius))
                found.append((each.number, x + column, y + row, size, float(each.shown)))
    return np.array(found, dtype=np.float32).reshape(-1, 5)


def _way(mesh: Mesh, point: int, ray: Floats) -> tuple[float, float]:
    """Right and up [cells] from a point to a ray (3,), by the differences of the rays around the point."""
    beside = mesh.neighbors[point, [_RIGHT, _LEFT, _UP, _DOWN]]
    around = np.where((beside < len(mesh))[:, None], mesh.rays[np.minimum(beside, len(mesh) - 1)], mesh.rays[point])
    missing = np.count_nonzero((beside >= len(mesh)).reshape(2, 2), axis=1)
    steps = (around[::2] - around[1::2]) / np.maximum(2 - missing, 1)[:, None]
    right, up = np.linalg.lstsq(steps.T, ray - mesh.rays[point], rcond=None)[0].tolist()
    return right, up


def peak_targets(cells: Indices, labels: Labels, objects: Singles, classes: Sequence[int]) -> PeakTargets:
    """The targets of n points with cells (n, 2) and labels (n,), from objects (o, 5) as `in_cells` gives them.

    classes: numbers of the classes with peaks.
    """
    shape = len(cells), len(classes)
    score, way = np.zeros(shape, np.float32), np.zeros((*shape, 3), np.float32)
    near, counts = np.zeros(shape, bool), np.repeat((labels >= 0)[:, None], len(classes), axis=1)
    nearest = np.full(shape, np.inf, np.float32)
    for number, column, row, size, shown in objects.tolist():
        at = classes.index(int(number))
        if shown < 0.0:
            counts[:, at] = False
            continue
        step = np.array([column, row], np.float32) - cells
        square = step[:, 0] ** 2 + step[:, 1] ** 2
        beside = square <= _NEAR**2
        if not shown:
            counts[beside, at] = False
            continue
        # Below 1, which marks the cell that has the place in it.
        score[:, at] = np.maximum(score[:, at], 0.99 * np.exp(-square / (2.0 * _BELL**2)))
        own = np.abs(step).max(axis=1) <= 0.5
        score[own, at] = 1.0
        nearer = beside & (square < nearest[:, at]) & (labels >= 0)
        nearest[nearer, at] = square[nearer]
        way[nearer, at, :2], way[nearer, at, 2] = step[nearer], size
        near[nearer, at] = True
    return PeakTargets(score, counts, way, near)
