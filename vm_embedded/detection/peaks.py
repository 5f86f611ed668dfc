"""Peaks: where a network on strips says that objects are.

Each point has a score, the way to the place of an object, and a size (`Manifest.peaks`). A peak is a point with a
higher score than its eight neighbors. The way leads to a place between points: a row is many percent of the distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats, Mask, Singles
from ..mesh.mesh import Mesh
from ..mesh.octaves import Octaves
from ..network.manifest import PEAK_OUTPUTS, Manifest
from .prepared_view import PreparedView

LARGEST_SIZE = 3.0
"""Limit of the logarithm of a size: with a bad network, its exponential would overflow, and JSON has no infinity."""

_LEAST = -3.0
"""Lowest score of a peak: a probability of 0.05."""

_FARTHEST = 2.0
"""Limit of a shift [cells]: straight ways along the mesh lead astray from farther away."""

_MOST = 32
"""Largest number of peaks of a class that are compared in pairs: a frame of noise must not take much longer."""

_RIGHT, _LEFT, _UP, _DOWN = (Octaves.steps.index(step) for step in ((1, 0), (-1, 0), (0, 1), (0, -1)))
"""Columns of these neighbors in the mesh."""


@dataclass(frozen=True, eq=False)
class Peaks:
    """Peaks of a class, best first.

    rays (p, 3): unit vectors from the camera to the places, in the mesh frame. scores (p,): logits of their
    probabilities. log_sizes (p,): logarithms of the objects' widths over the diameter of the object that the mesh is
    made for.
    """

    rays: Floats
    scores: Floats
    log_sizes: Floats

    def __len__(self) -> int:
        return len(self.scores)

    @property
    def probabilities(self) -> Floats:
        """Probabilities (p,) of objects there."""
        return probability_of(self.scores)

    def part(self, chosen: Chosen | Mask | slice) -> Peaks:
        """Some of the peaks."""
        return Peaks(self.rays[chosen], self.scores[chosen], self.log_sizes[chosen])

    def apart(self, view: PreparedView) -> Peaks:
        """The peaks that are not in the object of a better one; view: of objects of their class."""
        centers = view.shape.center_along(self.rays, view.height)
        return self.part(first_apart(view.shape.covers(self.rays, centers, view.height)))


def first_apart(near: Mask) -> Chosen:
    """Numbers of those of p places, best first, that are not near a better one that counts itself.

    near (p, p): whether each is so near the place of the row that it is the same one.
    """
    numbers = np.arange(len(near))
    worse = near & (numbers > numbers[:, None])
    kept = np.ones(len(near), dtype=bool)
    for better in np.flatnonzero(worse.any(axis=1)):
        if kept[better]:
            kept &= ~worse[better]
    return np.flatnonzero(kept)


def probability_of(logits: Floats) -> Floats:
    """Probabilities (n,) with these log-odds (n,)."""
    return np.asarray(0.5 + 0.5 * np.tanh(0.5 * logits))  # never overflows


def peaks_of(answers: Singles, numbers: Chosen, view: PreparedView, manifest: Manifest) -> dict[str, Peaks]:
    """The peaks of each class that the network has peaks for, from the answers (n, outputs) to points of the mesh.

    numbers (n,): of the points, which alone count. Of two peaks in one object, as two strips may show it, the better
    one counts. All classes together take little more time than one.
    """
    outputs = answers.T[len(manifest.classes) :]
    score, right, up, size = (outputs[number::PEAK_OUTPUTS] for number in range(PEAK_OUTPUTS))
    kinds, at = _highest(score, numbers, view.mesh)
    rays = _moved(view.mesh, numbers[at], right[kinds, at], up[kinds, at])
    covered = view.shape.covers(rays, view.shape.center_along(rays, view.height), view.height)
    chosen = first_apart(covered & (kinds == kinds[:, None]))
    kinds, at = kinds[chosen], at[chosen]
    sizes = np.minimum(np.maximum(size[kinds, at], -LARGEST_SIZE), LARGEST_SIZE)  # three times as fast as np.clip
    found = Peaks(rays[chosen], score[kinds, at].astype(np.float64), sizes.astype(np.float64))
    ends = np.searchsorted(kinds, np.arange(len(score) + 1))
    return {name: found.part(slice(ends[at], ends[at + 1])) for at, name in enumerate(manifest.peaks)}


def _highest(score: Singles, numbers: Chosen, mesh: Mesh) -> tuple[Chosen, Chosen]:
    """Number of the class (p,), and which point (p,) of those with these numbers in the mesh (n,), where the score
    (P, n) is higher than at all neighbors.

    The classes follow each other, and the points of each are sorted from best to worst.
    """
    kinds, at = np.nonzero(score >= _LEAST)
    seen = np.full((len(score), len(mesh) + 1), -np.inf, dtype=np.float32)
    for row, own in zip(seen, score, strict=True):
        row[numbers] = own
    beside = np.take(mesh.neighbors, numbers[at], axis=0) + (kinds * len(mesh.neighbors))[:, None]
    high = seen.take(beside.T).max(axis=0, initial=-np.inf) <= score[kinds, at]
    kinds, at = kinds[high], at[high]
    order = np.lexsort([-score[kinds, at], kinds])
    kinds, at = kinds[order], at[order]
    if len(kinds) > _MOST:
        best = np.arange(len(kinds)) - np.searchsorted(kinds, kinds) < _MOST
        kinds, at = kinds[best], at[best]
    return kinds, at


def _moved(mesh: Mesh, points: Chosen, right: Singles, up: Singles) -> Floats:
    """Unit vectors (p, 3) to places that are shifted [cells] to the right and up (p,) from p points of a mesh.

    A step is half the difference between the rays of the points on both sides; if one of them is missing, the
    difference to the other one.
    """
    beside = mesh.neighbors[points][:, [_RIGHT, _UP, _LEFT, _DOWN]].T
    missing = beside == len(mesh)
    own = mesh.rays.T[:, points]
    around = mesh.rays.T[:, np.where(missing, points, beside)]  # (3, 4, p)
    apart = np.maximum(2.0 - missing[:2] - missing[2:], 1.0)
    shifts = np.minimum(np.maximum([right, up], -_FARTHEST), _FARTHEST) / apart
    moved = own + ((around[:, :2] - around[:, 2:]) * shifts).sum(axis=1)
    moved /= np.sqrt((moved * moved).sum(axis=0))
    return np.asarray(moved.T)
