"""Peaks: where a network on a canvas says that objects are.

Each cell has a score, the way to the place of an object, and a size (`Manifest.peaks`). A peak is a cell with a higher
score than the eight cells around it. The way leads to a place between cells: a row is many percent of the distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..arrays import Chosen, Floats, Mask, Singles
from ..network.canvas_layout import CanvasLayout
from ..network.manifest import PEAK_OUTPUTS, Manifest
from .prepared_view import PreparedView

LARGEST_SIZE = 3.0
"""Limit of the logarithm of a size: with a bad network, its exponential would overflow, and JSON has no infinity."""

_LEAST = -3.9
"""Lowest score of a peak: a probability of 0.02."""

_FARTHEST = 2.0
"""Limit of a shift [cells]: straight ways along the mesh lead astray from farther away."""

_MOST = 32
"""Largest number of peaks of a class that are compared in pairs: a frame of noise must not take much longer."""

_AROUND = np.ones((3, 3), dtype=np.uint8)


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


def peaks_of(answers: Singles, on_screen: Mask, view: PreparedView, manifest: Manifest) -> dict[str, Peaks]:
    """The peaks of each class that the network has peaks for, from the answers (m, outputs) to the slots of a canvas.

    on_screen (m,): the cells that count. Of two peaks in one object, as two strips may show it, the better one counts.
    All classes together take little more time than one.
    """
    layout, outputs = view.layout, answers.T[len(manifest.classes) :]
    assert isinstance(layout, CanvasLayout)
    score, right, up, size = (outputs[number::PEAK_OUTPUTS] for number in range(PEAK_OUTPUTS))
    kinds, cells = _highest(score, on_screen, layout.shape)
    rays = _moved(layout, cells, right[kinds, cells], up[kinds, cells])
    covered = view.shape.covers(rays, view.shape.center_along(rays, view.height), view.height)
    chosen = first_apart(covered & (kinds == kinds[:, None]))
    kinds, cells = kinds[chosen], cells[chosen]
    sizes = np.minimum(np.maximum(size[kinds, cells], -LARGEST_SIZE), LARGEST_SIZE)  # three times as fast as np.clip
    found = Peaks(rays[chosen], score[kinds, cells].astype(np.float64), sizes.astype(np.float64))
    ends = np.searchsorted(kinds, np.arange(len(score) + 1))
    return {name: found.part(slice(ends[at], ends[at + 1])) for at, name in enumerate(manifest.peaks)}


def _highest(score: Singles, on_screen: Mask, shape: tuple[int, int]) -> tuple[Chosen, Chosen]:
    """Number of the class (p,), and cell (p,) of a canvas of this shape, where the score (P, m) is higher than around.

    The classes follow each other, and the cells of each are sorted from best to worst.
    """
    rows, columns = shape
    seen = np.full((len(score), rows + 1, columns), -np.inf, dtype=np.float32)  # with a gap after each class
    np.copyto(seen[:, :-1], score.reshape(-1, rows, columns), where=on_screen.reshape(shape))
    around = cv2.dilate(seen.reshape(-1, columns), _AROUND).reshape(seen.shape)[:, :-1]
    high = (seen[:, :-1] == around) & (around >= _LEAST)
    kinds, cells = np.divmod(np.flatnonzero(high), rows * columns)
    order = np.lexsort([-score[kinds, cells], kinds])
    kinds, cells = kinds[order], cells[order]
    if len(kinds) > _MOST:
        best = np.arange(len(kinds)) - np.searchsorted(kinds, kinds) < _MOST
        kinds, cells = kinds[best], cells[best]
    return kinds, cells


def _moved(layout: CanvasLayout, cells: Chosen, right: Singles, up: Singles) -> Floats:
    """Unit vectors (p, 3) to places that are shifted [cells] to the right and up (p,) from p slots of a canvas.

    A step is half the difference between the rays of the cells on both sides; if one of them is missing, the difference
    to the other one.
    """
    columns = layout.shape[1]
    beside = cells + np.array([[0], [1], [-1], [-columns], [columns]])  # itself, right, left, up, down
    rays = layout.rays.T.take(beside, axis=1, mode="clip")  # (3, 5, p)
    own, around = rays[:, :1], rays[:, 1:]
    missing = np.isnan(around[0]) | (beside[1:] < 0) | (beside[1:] >= len(layout))
    column = cells % columns
    missing[0] |= column == columns - 1
    missing[1] |= column == 0
    np.copyto(around, own, where=missing)
    apart = np.maximum(2.0 - missing[::2] - missing[1::2], 1.0)
    shifts = np.minimum(np.maximum([right, up], -_FARTHEST), _FARTHEST) / apart
    moved = own[:, 0] + ((around[:, ::2] - around[:, 1::2]) * shifts).sum(axis=1)
    moved /= np.sqrt((moved * moved).sum(axis=0))
    return np.asarray(moved.T)
