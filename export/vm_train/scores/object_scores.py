"""Scores of found objects: precision and recall at an overlap, false objects, and errors of place; all by distance.

Distances are on the plane, from the point below the camera to the point below the object's center, for true and found
objects alike. The rules are those of COCO:

- The overlap of a found and a true object is the intersection of their pixels over the union (IoU).
- In each picture, the found objects choose in the order of their confidence. Each takes the true object that it
  overlaps most, among those that are free and that it overlaps by at least the threshold. A found object without a true
  one is false; so if several lie on the same true object, all but one are false.
- True objects that are hardly visible or too small are ignored: they never count as missed. A found object that gets no
  true one, but overlaps an ignored one by the threshold, does not count either. This overlap is the intersection over
  the smaller of the two areas: of a ball behind a leg little is visible, but a correct outline surrounds all of it.
- A distance bin has the true objects in it, the found objects that match them, and the false objects whose own distance
  is in the bin.

Scores without a value, such as the recall without any true object, are NaN, never 0; `as_dict` writes None.
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
from .overlaps import FoundObject, TrueObject, common_areas

OVERLAPS = (0.5, 0.75)
"""Least IoU of a correctly found object.

The paper has 0.75, because at 0.5 the center may lie on the edge (section "Precision").
"""

MIN_VISIBLE = 0.25
"""Least visible share of a true object that counts."""

AnyFound = TypeVar("AnyFound", bound=FoundObject)


@dataclass(frozen=True)
class _CountedObject:
    """A found object that counts, with the fields of `ObjectRanking`."""

    confidence: float
    right: bool
    true_distance: float
    found_distance: float
    place_error: float
    center_error: float


@dataclass(frozen=True, eq=False)
class Mistakes(Generic[AnyFound]):
    """The missed true objects of a picture, and its false found objects, the most confident first."""

    missed: tuple[TrueObject, ...]
    false: tuple[AnyFound, ...]


class ObjectScores:
    """Scores of the objects of all pictures so far. They are exact: it keeps six numbers of every found object.

    distance_edges (D + 1,) [m]: bins include their lower edge; objects outside all bins count only in scores over all
    distances. overlaps: thresholds of IoU. min_visible, min_radius [px]: true objects with a smaller visible share or
    radius are ignored; `ignored` is their number. pictures: number of pictures. Raises InputError for edges that do not
    rise, and for overlaps outside 0 to 1.
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
            raise InputError(f"overlaps must be above 0 and at most 1, not {list(overlaps)}")
        self.min_visible = min_visible
        self.min_radius = min_radius
        self.pictures = 0
        self.ignored = 0
        self._truths: list[float] = []
        self._counted: dict[float, list[_CountedObject]] = {each: [] for each in self.overlaps}

    def add(self, truths: Sequence[TrueObject], found: Sequence[AnyFound]) -> Mistakes[AnyFound]:
        """Add a picture: its true objects, whose masks have the same size, and the objects found in it.

        Returns the mistakes at the first overlap.
        """
        counted = [each for each in truths if not self._ignores(each)]
        ignored = [each for each in truths if self._ignores(each)]
        common = common_areas(counted + ignored, found)
        overlap = common.iou[:, : len(counted)]
        excuse = common.over_smaller[:, len(counted) :].max(axis=1, initial=0.0)
        order = np.argsort([-each.confidence for each in found], kind="stable")
        mistakes: list[Mistakes[AnyFound]] = []
        for threshold, counts in self._counted.items():
            missed, false = dict(enumerate(counted)), []
            for number, choice in zip(order, matches(overlap[order], threshold), strict=True):
                if choice is not None:
                    counts.append(_counted_object(found[number], missed.pop(choice)))
                elif excuse[number] < threshold:
                    counts.append(_counted_object(found[number], None))
                    false.append(found[number])
            mistakes.append(Mistakes(tuple(missed.values()), tuple(false)))
        self._truths.extend(_distance(each.position) for each in counted)
        self.ignored += len(ignored)
        self.pictures += 1
        return mistakes[0]

    def _ignores(self, truth: TrueObject) -> bool:
        return truth.is_ignored(self.min_visible, self.min_radius)

    def __add__(self, other: ObjectScores) -> ObjectScores:
        """Scores of the pictures of both. Raises InputError if their rules differ."""
        if self._rules != other._rules:
            raise InputError(
                "scores with different distance bins, overlaps, or limits for ignored objects do not add up"
            )
        both = ObjectScores(self.distance_edges, self.overlaps, self.min_visible, self.min_radius)
        both.pictures = self.pictures + other.pictures
        both.ignored = self.ignored + other.ignored
        both._truths = self._truths + other._truths
        both._counted = {each: self._counted[each] + other._counted[each] for each in self.overlaps}
        return both

    @property
    def _rules(self) -> tuple[Any, ...]:
        return self.distance_edges.tolist(), self.overlaps, self.min_visible, self.min_radius

    def ranking(self, overlap: float, distance_bin: int | range | None = None) -> ObjectRanking:
        """The ranking at one of the overlaps, of all objects or of those in one or several distance bins, from 0.

        Raises InputError for an overlap that is not among `overlaps`.
        """
        if overlap not in self._counted:
            raise InputError(f"no scores at overlap {overlap:g}, only at {list(self.overlaps)}")
        counted = self._counted[overlap]
        right = np.array([each.right for each in counted], dtype=bool)
        true = np.array([each.true_distance for each in counted], dtype=np.float64)
        found = np.array([each.found_distance for each in counted], dtype=np.float64)
        here = self._within(np.where(right, true, found), distance_bin)
        return ObjectRanking(
            confidence=np.array([each.confidence for each in counted], dtype=np.float64)[here],
            right=right[here],
            true_distance=true[here],
            found_distance=found[here],
            place_error=np.array([each.place_error for each in counted], dtype=np.float64)[here],
            center_error=np.array([each.center_error for each in counted], dtype=np.float64)[here],
            truths=int(self._within(np.array(self._truths, dtype=np.float64), distance_bin).sum()),
            pictures=self.pictures,
        )

    def _within(self, distances: Floats, distance_bin: int | range | None) -> Mask:
        """Whether distances (n,) are in one or several bins; all are if it is None."""
        if distance_bin is None:
            return np.ones(len(distances), dtype=bool)
        bins = range(len(self.distance_edges) - 1)
        numbers = distance_bin if isinstance(distance_bin, range) else [bins[distance_bin]]
        return np.isin(bins_of(distances, self.distance_edges), numbers)


def matches(overlap: Floats, threshold: float) -> list[int | None]:
    """The number of the true object that each found object gets, or None, from their overlaps (n, m).

    Found objects are in the order of their confidence, the most confident first.
    """
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


def _counted_object(found: FoundObject, truth: TrueObject | None) -> _CountedObject:
    true = np.full(3, np.nan) if truth is None else truth.position
    return _CountedObject(
        confidence=float(found.confidence),
        right=truth is not None,
        true_distance=_distance(true),
        found_distance=_distance(found.position),
        place_error=_distance(found.position - true),
        center_error=math.nan if truth is None else float(truth.offsets(found.bearing[None])[0]),
    )
