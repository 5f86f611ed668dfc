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
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask, Singles
from vm_embedded.errors import InputError
from vm_embedded.lens import Size

from .point_scores import DISTANCE_EDGES, PrecisionRecall, bins_of, checked_edges, ratio, shares, without_nan

OVERLAPS = (0.5, 0.75)
"""IoU from which a found object is right; the paper has 0.75, because at 0.5 the center may lie on the edge."""

MIN_VISIBLE = 0.25

_LINES = 8
"""Scan lines per row of pixels, along which the share inside an outline is exact."""

Window = tuple[slice, slice]
"""Rows and columns of a picture."""


class Found(Protocol):
    """What is needed of a found object; `vm_embedded.detections.Detection` is one.

    confidence. outline (m, 2) [px]: of the whole object, also beyond the picture. position (3,) [m]: on the plane.
    """

    @property
    def confidence(self) -> float: ...
    @property
    def outline(self) -> Floats: ...
    @property
    def position(self) -> Floats: ...


@dataclass(frozen=True, eq=False)
class TrueObject:
    """An object that is in a picture.

    mask (h, w): bool, or the share of each pixel that is the object's, 0 to 1. It is what shows of the object, or all
    of it inside the picture, where that is known: of what shows, an outline of the whole can't overlap more than
    `visible`. position (3,) [m]: on the plane, in the frame of what is found; NaN if not known. radius [px]: of a disk
    as large as its whole outline. visible: share of that outline that shows.
    """

    mask: Mask | Singles
    position: Floats
    radius: float
    visible: float = 1.0


@dataclass(frozen=True, eq=False)
class Errors:
    """Of found objects that are right: their number, and errors [m] of distance and of place on the plane.

    distance_*: of absolute errors. bias: median of signed ones, above 0 if found too far. relative_*: of absolute
    errors over the true distance. place_*: from the true point on the plane to the found one. NaN if there is none.
    """

    count: int
    distance_median: float
    distance_p90: float
    bias: float
    relative_median: float
    relative_p90: float
    place_median: float
    place_p90: float


@dataclass(frozen=True)
class ObjectOutcome:
    """Numbers of objects that were found (hits) or not (missed), of false ones, and of pictures."""

    hits: int
    false: int
    missed: int
    pictures: int

    @property
    def precision(self) -> float:
        """Share of the found that is right; NaN if nothing was found."""
        return ratio(self.hits, self.hits + self.false)

    @property
    def recall(self) -> float:
        """Share of the true that was found; NaN if there is none."""
        return ratio(self.hits, self.hits + self.missed)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall, 0 without a hit; NaN if there are no true objects."""
        if self.hits + self.missed == 0:
            return math.nan
        return ratio(2 * self.hits, 2 * self.hits + self.false + self.missed)

    @property
    def false_per_picture(self) -> float:
        """False ones in a picture; NaN without pictures."""
        return ratio(self.false, self.pictures)


@dataclass(frozen=True, eq=False)
class ObjectRanking:
    """Found objects that count, at one overlap: of each confidence (m,), whether it is right (m,), true and found
    distance (m,) [m], and error of place (m,) [m]; true distance and place are NaN for false ones. truths: number of
    true objects that count. pictures: number of pictures, of all distances."""

    confidence: Floats
    right: Mask
    true_distance: Floats
    found_distance: Floats
    place_error: Floats
    truths: int
    pictures: int

    @cached_property
    def precision_recall(self) -> PrecisionRecall:
        """The curve over all confidences. Its average precision is 0 if there are objects and none is found."""
        order = np.argsort(-self.confidence)
        ranked, hits = self.confidence[order], np.cumsum(self.right[order], dtype=np.int64)
        # Equals are reported together, so that the curve does not depend on the order of pictures.
        last = np.flatnonzero(np.diff(ranked, append=-np.inf))  # of each group of equals
        return PrecisionRecall(ranked[last], hits[last] / (last + 1.0), shares(hits[last], self.truths), self.truths)

    def at(self, confidence: float = 0.0) -> ObjectOutcome:
        """What comes of reporting all of this confidence or above."""
        reported = self.confidence >= confidence
        hits = int((self.right & reported).sum())
        return ObjectOutcome(hits, int(reported.sum()) - hits, self.truths - hits, self.pictures)

    def errors(self, confidence: float = 0.0) -> Errors:
        """Errors of the right ones of this confidence or above whose true place is known."""
        chosen = self.right & (self.confidence >= confidence) & np.isfinite(self.true_distance + self.found_distance)
        true = self.true_distance[chosen]
        signed = self.found_distance[chosen] - true
        absolute = np.abs(signed)
        away = true > 0.0  # straight below the camera no error is a share of the distance
        relative = absolute[away] / true[away]
        place = self.place_error[chosen]
        return Errors(
            count=len(true),
            distance_median=_quantile(absolute, 0.5),
            distance_p90=_quantile(absolute, 0.9),
            bias=_quantile(signed, 0.5),
            relative_median=_quantile(relative, 0.5),
            relative_p90=_quantile(relative, 0.9),
            place_median=_quantile(place, 0.5),
            place_p90=_quantile(place, 0.9),
        )

    def as_dict(self, confidence: float = 0.0) -> dict[str, Any]:
        """All numbers but the curve, for JSON."""
        outcome = self.at(confidence)
        counts = {"truths": self.truths, "pictures": self.pictures, "hits": outcome.hits, "false": outcome.false}
        values = {
            "average_precision": self.precision_recall.average_precision,
            "confidence": confidence,
            "precision": outcome.precision,
            "recall": outcome.recall,
            "f1": outcome.f1,
            "false_per_picture": outcome.false_per_picture,
        }
        return counts | without_nan(values) | {"errors": without_nan(vars(self.errors(confidence)))}


@dataclass(frozen=True)
class _Find:
    """A found object that counts, as the fields of `ObjectRanking` have it."""

    confidence: float
    right: bool
    true_distance: float
    found_distance: float
    place_error: float


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

    def add(self, truths: Sequence[TrueObject], found: Sequence[Found]) -> None:
        """Count a picture: its true objects, with masks of the same size, and what was found in it."""
        counted = [each for each in truths if not self._ignores(each)]
        ignored = [each for each in truths if self._ignores(each)]
        common = _common(counted + ignored, found)
        union = common.found + common.true - common.both
        overlap = _over(common.both, union)[:, : len(counted)]
        excuse = _over(common.both, np.minimum(common.found, common.true))[:, len(counted) :].max(axis=1, initial=0.0)
        order = np.argsort([-each.confidence for each in found], kind="stable")
        for threshold, finds in self._finds.items():
            for number, choice in zip(order, chosen(overlap[order], threshold), strict=True):
                if choice is not None:
                    finds.append(_find(found[number], counted[choice]))
                elif excuse[number] < threshold:
                    finds.append(_find(found[number], None))
        self._truths.extend(_distance(each.position) for each in counted)
        self.ignored += len(ignored)
        self.pictures += 1

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

    def ranking(self, overlap: float, distance_bin: int | None = None) -> ObjectRanking:
        """Ranking at one of the overlaps, of all objects or of those in a distance bin, counted from 0. Raises
        InputError for an overlap that was not asked for."""
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

    def _within(self, distances: Floats, distance_bin: int | None) -> Mask:
        """Which distances (n,) are in a bin; all if it is None."""
        if distance_bin is None:
            return np.ones(len(distances), dtype=bool)
        number = range(len(self.distance_edges) - 1)[distance_bin]
        return np.asarray(bins_of(distances, self.distance_edges) == number)


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


def coverage(outline: Floats, size: Size) -> tuple[Window, Floats]:
    """A window of the picture that the polygon (m, 2) [px] lies in, and the share (h, w) of each of its pixels inside.

    Corners that are not finite are left out. Where the outline crosses itself, what it goes around twice is outside.
    """
    corners = outline[np.isfinite(outline).all(axis=1)]
    if len(corners) < 3:
        return (slice(0, 0), slice(0, 0)), np.zeros((0, 0))
    left, top = np.clip(np.rint(corners.min(axis=0)), 0, size).astype(int)
    right, bottom = np.clip(np.rint(corners.max(axis=0)) + 1, 0, size).astype(int)
    rows, columns = np.arange(top, bottom)[:, None], np.arange(left, right)
    share = np.zeros((len(rows), len(columns)))
    x, y = corners.T
    next_x, next_y = np.roll(corners, -1, axis=0).T
    for line in range(_LINES):
        height = rows + (line + 0.5) / _LINES - 0.5
        crosses = (y <= height) != (next_y <= height)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossings = np.where(crosses, x + (height - y) * ((next_x - x) / (next_y - y)), np.inf)
        crossings.sort(axis=1)
        # What is right of a crossing turns from outside to inside, and at the next one back.
        for number in range(int(crosses.sum(axis=1).max(initial=0))):
            beyond = np.clip(columns + 0.5 - crossings[:, number, None], 0.0, 1.0)
            share += -beyond if number % 2 else beyond
    return (slice(int(top), int(bottom)), slice(int(left), int(right))), share / _LINES


@dataclass(frozen=True, eq=False)
class _Common:
    """Areas (n, m) [px^2] of n found and m true objects in the picture, and what they have in common."""

    found: Floats
    true: Floats
    both: Floats


def _common(truths: Sequence[TrueObject], found: Sequence[Found]) -> _Common:
    """What the found and the true objects have in common.

    With a mask of whole pixels, a pixel is the found one's if half of it or more is: a right outline then overlaps
    wholly. With one of shares, the common share of a pixel is the lesser of the two.
    """
    common = _Common(*np.zeros((3, len(found), len(truths))))
    if not truths:
        return common
    height, width = truths[0].mask.shape
    areas = [float(each.mask.sum(dtype=np.float64)) for each in truths]
    for row, each in enumerate(found):
        window, share = coverage(each.outline, (width, height))
        whole = (share >= 0.5).astype(np.float64)
        for column, truth in enumerate(truths):
            inside = whole if truth.mask.dtype == bool else share
            common.found[row, column] = inside.sum()
            common.true[row, column] = areas[column]
            common.both[row, column] = np.minimum(inside, truth.mask[window]).sum()
    return common


def _over(part: Floats, whole: Floats) -> Floats:
    """part / whole (n, m), 0 where there is no whole."""
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0.0)


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


def _quantile(values: npt.NDArray[np.float64], share: float) -> float:
    """Value below which that share of the values (n,) is; NaN if there is none."""
    return float(np.quantile(values, share)) if len(values) else math.nan
