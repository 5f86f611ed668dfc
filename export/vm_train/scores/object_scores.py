"""How well objects are found: precision and recall at an overlap, false ones, errors of distance; all by distance.

An object's distance is on the plane, from the point below the camera to the point below its center, for true and found
ones alike. The rules are those of COCO:

- The overlap of a found and a true object is the intersection of their pixels over their union (IoU).
- In each picture the most confident one chooses first: of the true objects that it overlaps by the threshold or more
  and that nobody has chosen, the one that it overlaps most. Who gets none is false, so all but one of several on the
  same object are.
- Objects that hardly show or are too small are ignored: not missed if nobody finds them; and who gets no other, but
  covers or lies in an ignored one by the threshold (intersection over the smaller of the two), counts nowhere. The
  smaller, not the union: of a ball behind a leg little shows, and a right outline goes around all of it.
- In a distance bin are the true objects that stand there, who found one of them, and the false that claim to be there.

A score without a value, as the recall where no object is, is NaN, never 0; `as_dict` makes it None.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from vm_embedded.arrays import Floats, Mask
from vm_embedded.errors import InputError

from .distance_bins import DISTANCE_EDGES, bins_of, checked_edges
from .object_ranking import ObjectRanking
from .overlaps import Found, TrueObject, common_areas

OVERLAPS = (0.5, 0.75)
"""IoU from which a found object is right; the paper has 0.75, because at 0.5 the center may lie on the edge."""

MIN_VISIBLE = 0.25

AnyFound = TypeVar("AnyFound", bound=Found)


@dataclass(frozen=True)
class _Find:
    """A found object that counts, as the fields of `ObjectRanking` have it."""

    confidence: float
    right: bool
    true_distance: float
    found_distance: float
    place_error: float


@dataclass(frozen=True, eq=False)
class Mistakes(Generic[AnyFound]):
    """True objects of a picture that nobody found, and found ones that are false, most confident first."""

    missed: tuple[TrueObject, ...]
    false: tuple[AnyFound, ...]


class ObjectScores:
    """Scores of the objects of all pictures so far. It remembers five numbers of every found object, so that all
    scores are exact.

    distance_edges (D + 1,) [m]: of bins that include their lower edge; objects in no bin count only where no bin is
    asked for. overlaps: thresholds of IoU. Objects of which less than min_visible shows, or of a radius under
    min_radius [px], are ignored. ignored: their number. pictures: number of pictures. Raises InputError for edges that
    do not rise, or overlaps that are not above 0 and up to 1.
    """

    def __init__(
        self,
        distance_edges: Floats = DISTANCE_EDGES,
        overlaps: Sequence[float] = OVERLAPS,
        min_visible: float = MIN_VISIBLE,
        min_radius: float = 0.0,
    ) -> None:
        self.distance_edges = checked_edges(distance_edges)
        self.overlaps = tuple(overlaps)
        if not self.overlaps or not all(0.0 < each <= 1.0 for each in self.overlaps):
            raise InputError(f"overlaps must be shares above 0 and up to 1, not {list(overlaps)}")
        self.min_visible = min_visible
        self.min_radius = min_radius
        self.pictures = 0
        self.ignored = 0
        self._truths: list[float] = []
        self._finds: dict[float, list[_Find]] = {each: [] for each in self.overlaps}

    def add(self, truths: Sequence[TrueObject], found: Sequence[AnyFound]) -> Mistakes[AnyFound]:
        """Count a picture: its true objects, with masks of the same size, and what was found in it.

        Returns what is wrong at the first of the overlaps.
        """
        counted = [each for each in truths if not self._ignores(each)]
        ignored = [each for each in truths if self._ignores(each)]
        common = common_areas(counted + ignored, found)
        overlap = common.of_union[:, : len(counted)]
        excuse = common.of_lesser[:, len(counted) :].max(axis=1, initial=0.0)
        order = np.argsort([-each.confidence for each in found], kind="stable")
        mistakes: list[Mistakes[AnyFound]] = []
        for threshold, finds in self._finds.items():
            missed, false = dict(enumerate(counted)), []
            for number, choice in zip(order, chosen(overlap[order], threshold), strict=True):
                if choice is not None:
                    finds.append(_find(found[number], missed.pop(choice)))
                elif excuse[number] < threshold:
                    finds.append(_find(found[number], None))
                    false.append(found[number])
            mistakes.append(Mistakes(tuple(missed.values()), tuple(false)))
        self._truths.extend(_distance(each.position) for each in counted)
        self.ignored += len(ignored)
        self.pictures += 1
        return mistakes[0]

    def _ignores(self, truth: TrueObject) -> bool:
        return truth.visible < self.min_visible or truth.radius < self.min_radius

    def __add__(self, other: ObjectScores) -> ObjectScores:
        """Scores of the pictures of both. Raises InputError if they were made by other rules."""
        if self._rules != other._rules:
            raise InputError("scores of different distances, overlaps or rules of what is ignored do not add up")
        both = ObjectScores(self.distance_edges, self.overlaps, self.min_visible, self.min_radius)
        both.pictures = self.pictures + other.pictures
        both.ignored = self.ignored + other.ignored
        both._truths = self._truths + other._truths
        both._finds = {each: self._finds[each] + other._finds[each] for each in self.overlaps}
        return both

    @property
    def _rules(self) -> tuple[Any, ...]:
        return self.distance_edges.tolist(), self.overlaps, self.min_visible, self.min_radius

    def ranking(self, overlap: float, distance_bin: int | range | None = None) -> ObjectRanking:
        """Ranking at one of the overlaps, of all objects or of those in a distance bin or several, counted from 0.
        Raises InputError for an overlap that was not asked for."""
        if overlap not in self._finds:
            raise InputError(f"overlap {overlap:g} was not scored, only {list(self.overlaps)}")
        finds = self._finds[overlap]
        right = np.array([each.right for each in finds], dtype=bool)
        true = np.array([each.true_distance for each in finds], dtype=np.float64)
        claimed = np.array([each.found_distance for each in finds], dtype=np.float64)
        here = self._within(np.where(right, true, claimed), distance_bin)
        return ObjectRanking(
            confidence=np.array([each.confidence for each in finds], dtype=np.float64)[here],
            right=right[here],
            true_distance=true[here],
            found_distance=claimed[here],
            place_error=np.array([each.place_error for each in finds], dtype=np.float64)[here],
            truths=int(self._within(np.array(self._truths, dtype=np.float64), distance_bin).sum()),
            pictures=self.pictures,
        )

    def _within(self, distances: Floats, distance_bin: int | range | None) -> Mask:
        """Which distances (n,) are in a bin or several; all if it is None."""
        if distance_bin is None:
            return np.ones(len(distances), dtype=bool)
        bins = range(len(self.distance_edges) - 1)
        numbers = distance_bin if isinstance(distance_bin, range) else [bins[distance_bin]]
        return np.isin(bins_of(distances, self.distance_edges), numbers)


def chosen(overlap: Floats, threshold: float) -> list[int | None]:
    """For each found object, most confident first, the true one that it gets, from their overlaps (n, m)."""
    left = overlap.copy()
    choices: list[int | None] = []
    for row in range(len(left)):
        best = int(left[row].argmax()) if left.shape[1] else 0
        if left.shape[1] and left[row, best] >= threshold:
            choices.append(best)
            left[:, best] = -1.0
        else:
            choices.append(None)
    return choices


def _distance(position: Floats) -> float:
    """Distance on the plane [m]."""
    return math.hypot(float(position[0]), float(position[1]))


def _find(found: Found, truth: TrueObject | None) -> _Find:
    true = np.full(3, np.nan) if truth is None else truth.position
    return _Find(
        confidence=float(found.confidence),
        right=truth is not None,
        true_distance=_distance(true),
        found_distance=_distance(found.position),
        place_error=_distance(found.position - true),
    )
