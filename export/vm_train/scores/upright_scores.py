"""Scores of goal posts or robots: how many visible bases are found, how far off they are, and what else is reported.

A base is found if a report is near it, relative to its distance. A report that is less near, or that is near a base
that is hidden or outside of the picture, is neither found nor false: something stands there. Reports match bases one to
one, so a second report of the same post is false. Reports where people stand are counted apart.

Distances are on the plane, from the camera's foot. Scores without a value are NaN, never 0; `as_dict` writes None.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask
from vm_embedded.errors import InputError

from .curves import ratio, without_nan
from .distance_bins import bins_of, checked_edges, named_bins
from .object_ranking import Ranking

FIELD_EDGES: Floats = np.linspace(0.0, 10.0, 6)
"""Edges of the distance bins of field features [m]."""

LOOSE = 2.0
"""A report within this many tolerances of a base is not false."""

_FOUND, _NEAR, _PERSON, _FALSE = range(4)


@dataclass(frozen=True, eq=False)
class TrueUpright:
    """Something that stands on the plane. position (2,) [m]: its base. width [m]. visible: whether the base is."""

    position: Floats
    width: float
    visible: bool = True


class UprightScores:
    """Scores of one kind of upright in all pictures so far. They are exact: it keeps some numbers of every base and
    report.

    tolerance: largest error of a found base, as a share of its distance. limit [m]: distance up to which bases should
    be found. edges (D + 1,) [m]: bins include their lower edge. Raises InputError for edges that do not rise.
    """

    def __init__(self, tolerance: float, limit: float, edges: Floats = FIELD_EDGES) -> None:
        self.tolerance = tolerance
        self.limit = limit
        self.edges = checked_edges(edges)
        self.pictures = 0
        self._truths: list[tuple[float, float, bool]] = []  # distance, error [m] or NaN, found
        self._reports: list[tuple[float, int, float]] = []  # distance, outcome, confidence

    def add(
        self,
        truths: Sequence[TrueUpright],
        found: Sequence[Floats],
        people: Sequence[TrueUpright] = (),
        confidences: Sequence[float] | None = None,
    ) -> None:
        """Add a picture: its true uprights, visible or not, the reported positions (2,) [m], and its people.

        confidences: of the reports, 0 to 1; None: each report has confidence 1.
        """
        errors = _errors(truths, found)
        distances = np.array([_distance(each.position) for each in truths])
        visible = np.array([each.visible for each in truths], dtype=bool)
        strict = self.tolerance * distances
        hits = _pairs(np.where(visible[:, None] & (errors <= strict[:, None]), errors, np.inf))
        loose = errors.copy()
        for truth, report in hits.items():
            loose[truth], loose[:, report] = np.inf, np.inf
        near = _pairs(np.where(loose <= self._loose(truths)[:, None], loose, np.inf))
        outcomes = np.full(len(found), _FALSE)
        outcomes[(_errors(people, found) <= self._loose(people)[:, None]).any(axis=0)] = _PERSON
        outcomes[list(near.values())] = _NEAR
        outcomes[list(hits.values())] = _FOUND
        for number in np.flatnonzero(visible).tolist():
            match = (hits | near).get(number)
            error = math.nan if match is None else float(errors[number, match])
            self._truths.append((float(distances[number]), error, number in hits))
        distances_found = [_distance(each) for each in found]
        self._reports += zip(distances_found, outcomes.tolist(), confidences or [1.0] * len(found), strict=True)
        self.pictures += 1

    def _loose(self, truths: Sequence[TrueUpright]) -> Floats:
        """Errors (t,) [m] up to which a report is not false: it may also lie anywhere in a wide foot."""
        found = [max(LOOSE * self.tolerance * _distance(each.position), each.width / 2.0) for each in truths]
        return np.array(found, dtype=np.float64)

    def __add__(self, other: UprightScores) -> UprightScores:
        """Scores of the pictures of both. Raises InputError if their rules differ."""
        if self._rules != other._rules:
            raise InputError("scores with different distance bins, limits or tolerances do not add up")
        both = UprightScores(self.tolerance, self.limit, self.edges)
        both.pictures = self.pictures + other.pictures
        both._truths = self._truths + other._truths
        both._reports = self._reports + other._reports
        return both

    @property
    def _rules(self) -> tuple[Any, ...]:
        return self.tolerance, self.limit, self.edges.tolist()

    def row(self, distance_bin: int | None = None) -> dict[str, Any]:
        """All numbers of a distance bin, from 0, or of all distances. A report counts in the bin of its own place."""
        truths, reports = self._tables
        return self._row(self._within(truths[:, 0], distance_bin), self._within(reports[:, 0], distance_bin))

    def near_row(self) -> dict[str, Any]:
        """All numbers up to the limit."""
        truths, reports = self._tables
        return self._row(truths[:, 0] < self.limit, reports[:, 0] < self.limit)

    def _within(self, distances: Floats, distance_bin: int | None) -> Mask:
        if distance_bin is None:
            return np.ones(len(distances), dtype=bool)
        return np.asarray(bins_of(distances, self.edges) == distance_bin)

    def ranking(self) -> Ranking:
        """The reports that are found bases or false, at all distances."""
        _, outcomes, confidences = self._tables[1].T
        counts = np.isin(outcomes, (_FOUND, _FALSE))
        return Ranking(
            confidence=confidences[counts],
            right=outcomes[counts] == _FOUND,
            truths=len(self._truths),
            pictures=self.pictures,
        )

    @property
    def _tables(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Numbers of the visible bases (t, 3) and of the reports (r, 3), as they are kept."""
        truths = np.array(self._truths, dtype=np.float64).reshape(-1, 3)
        return truths, np.array(self._reports, dtype=np.float64).reshape(-1, 3)

    def _row(self, truths: Mask, reports: Mask) -> dict[str, Any]:
        kept, outcomes = self._tables[0][truths], self._tables[1][reports, 1]
        found, false = int(kept[:, 2].sum()), int((outcomes == _FALSE).sum())
        matched = kept[~np.isnan(kept[:, 1])]
        values = {
            "recall": ratio(found, len(kept)),
            "false_per_picture": ratio(false, self.pictures),
            "error_median": _median(matched[:, 1]),
            "relative_error_median": _median(matched[:, 1] / np.maximum(matched[:, 0], 1e-9)),
        }
        counts = {"visible": len(kept), "found": found, "reported": len(outcomes), "false": false}
        return counts | {"people": int((outcomes == _PERSON).sum())} | without_nan(values)

    def as_dict(self) -> dict[str, Any]:
        """All numbers, for JSON: over all distances, up to the limit and in each bin."""
        bins = {name: self.row(number) for name, number in named_bins(self.edges).items()}
        rules = {"pictures": self.pictures, "tolerance": self.tolerance, "limit": self.limit}
        return {**rules, "near": self.near_row(), **bins}


def _distance(position: Floats) -> float:
    return math.hypot(float(position[0]), float(position[1]))


def _errors(truths: Sequence[TrueUpright], found: Sequence[Floats]) -> Floats:
    """Distances (t, r) [m] between true and reported positions."""
    true = np.array([each.position for each in truths], dtype=np.float64).reshape(-1, 1, 2)
    return np.asarray(np.hypot(*np.moveaxis(true - np.array(found, dtype=np.float64).reshape(1, -1, 2), 2, 0)))


def _pairs(costs: Floats) -> dict[int, int]:
    """Pairs of a row and a column of costs (t, r), the cheapest first, each used once; infinite costs make no pair."""
    pairs: dict[int, int] = {}
    for place in np.argsort(costs, axis=None, kind="stable").tolist():
        row, column = divmod(place, costs.shape[1])
        if not math.isfinite(costs[row, column]):
            break
        if row not in pairs and column not in pairs.values():
            pairs[row] = column
    return pairs


def _median(values: Floats) -> float:
    return float(np.median(values)) if len(values) else math.nan
