"""Scores of field features: goal posts, robots, lines and the border of the field.

A sample of a line is right if it is within 5 cm or 3 % of its distance of a line of the other side, whichever is more.
Distances are on the plane, from the camera's foot. Scores without a value are NaN, never 0; `as_dict` writes None.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats, Mask
from vm_embedded.errors import InputError
from vm_embedded.field.features import FieldFeatures

from .border_scores import BorderScores
from .curves import Counts, ratio, without_nan
from .distance_bins import bins_of, checked_edges, named_bins
from .line_shapes import STEP, Lines
from .upright_scores import FIELD_EDGES, TrueUpright, UprightScores

TOLERANCE = 0.05
"""Least tolerance [m]."""

RELATIVE = 0.03
"""Tolerance as a share of the distance."""


class LineScores:
    """Scores of the lines in all pictures so far, kept as counts of samples.

    limit [m]: distance up to which lines should be found. edges (D + 1,) [m]: bins include their lower edge. Raises
    InputError for edges that do not rise.
    """

    def __init__(self, limit: float = 6.0, edges: Floats = FIELD_EDGES) -> None:
        self.limit = limit
        self.edges = checked_edges(edges)
        self.pictures = 0
        # Visible, found, reported and wrong samples in each bin: up to the limit, then beyond it and outside all bins.
        self._counts: Counts = np.zeros((4, len(self.edges), 2), dtype=np.int64)

    def add(self, true: Lines, visible: Floats, reported: Lines, shown: Floats) -> None:
        """Add a picture. visible (n, 2) [m]: samples of the true lines. shown (m, 2) [m]: of the reported lines."""
        self._count(0, visible)
        self._count(1, visible[reported.distances(visible) <= tolerances(visible)])
        self._count(2, shown)
        self._count(3, shown[true.distances(shown) > tolerances(shown)])
        self.pictures += 1

    def _count(self, what: int, points: Floats) -> None:
        distances = np.hypot(*points.T)
        np.add.at(self._counts[what], (bins_of(distances, self.edges), (distances >= self.limit).astype(np.intp)), 1)

    def __add__(self, other: LineScores) -> LineScores:
        """Scores of the pictures of both. Raises InputError if their rules differ."""
        if self.limit != other.limit or not np.array_equal(self.edges, other.edges):
            raise InputError("scores with different distance bins or limits do not add up")
        both = LineScores(self.limit, self.edges)
        both.pictures = self.pictures + other.pictures
        both._counts = self._counts + other._counts
        return both

    def row(self, distance_bin: int | None = None) -> dict[str, Any]:
        """Lengths [m] and shares of a distance bin, from 0, or of all distances."""
        chosen = self._counts if distance_bin is None else self._counts[:, [distance_bin]]
        return _row(chosen.sum(axis=(1, 2)))

    def near_row(self) -> dict[str, Any]:
        """Lengths [m] and shares up to the limit."""
        return _row(self._counts[:, :, 0].sum(axis=1))

    def as_dict(self) -> dict[str, Any]:
        """All numbers, for JSON: over all distances, up to the limit and in each bin."""
        bins = {name: self.row(number) for name, number in named_bins(self.edges).items()}
        return {"pictures": self.pictures, "limit": self.limit, "near": self.near_row(), **bins}


def tolerances(points: Floats) -> Floats:
    """Largest distances (n,) [m] of points (n, 2) from a line that is theirs."""
    return np.asarray(np.maximum(TOLERANCE, RELATIVE * np.hypot(*points.T)))


def _row(counts: Counts) -> dict[str, Any]:
    visible, found, reported, wrong = counts.tolist()
    lengths = {"visible": visible, "found": found, "reported": reported, "wrong": wrong}
    values = {"recall": ratio(found, visible), "wrong_share": ratio(wrong, reported)}
    return {name: round(count * STEP, 2) for name, count in lengths.items()} | without_nan(values)


@dataclass(frozen=True, eq=False)
class TrueField:
    """The true lines and border of a picture.

    lines: all of the field, visible or not. visible (n, 2) [m]: samples of those that the picture shows. directions
    (b,) [rad], distances (b,) [m]: of the border, where the picture shows it, as in BorderScores.
    """

    lines: Lines
    visible: Floats
    directions: Floats
    distances: Floats


@dataclass(frozen=True, eq=False)
class FieldTruth:
    """The truth about the field features of a picture; None for what its scene file does not tell.

    uprights: by kind: post, robot and person. shown: whether places (n, 2) [m] of the plane are inside the picture.
    """

    uprights: dict[str, Sequence[TrueUpright]] | None
    field: TrueField | None
    shown: Callable[[Floats], Mask]


@dataclass(eq=False)
class FieldScores:
    """Scores of the field features in all pictures so far."""

    posts: UprightScores = field(default_factory=lambda: UprightScores(tolerance=0.05, limit=8.0))
    robots: UprightScores = field(default_factory=lambda: UprightScores(tolerance=0.08, limit=6.0))
    lines: LineScores = field(default_factory=LineScores)
    border: BorderScores = field(default_factory=BorderScores)

    def add(self, truth: FieldTruth, found: FieldFeatures) -> None:
        """Add a picture: its truth, and the reported features."""
        if truth.uprights is not None:
            by_kind = truth.uprights
            for scores, kind, reports, people in (
                (self.posts, "post", found.posts, ()),
                (self.robots, "robot", found.robots, by_kind["person"]),
            ):
                positions, confidences = [each.position for each in reports], [each.confidence for each in reports]
                scores.add(by_kind[kind], positions, people, confidences)
        if truth.field is not None:
            lines, shown = reported_lines(found, truth.shown)
            self.lines.add(truth.field.lines, truth.field.visible, lines, shown)
            border = None if found.border is None else found.border.points
            self.border.add(truth.field.directions, truth.field.distances, border)

    def __add__(self, other: FieldScores) -> FieldScores:
        """Scores of the pictures of both. Raises InputError if their rules differ."""
        return FieldScores(
            self.posts + other.posts, self.robots + other.robots, self.lines + other.lines, self.border + other.border
        )

    def as_dict(self) -> dict[str, Any]:
        """All numbers, for JSON."""
        return {
            "posts": self.posts.as_dict(),
            "robots": self.robots.as_dict(),
            "lines": self.lines.as_dict(),
            "border": self.border.as_dict(),
        }


def reported_lines(found: FieldFeatures, shown: Callable[[Floats], Mask]) -> tuple[Lines, Floats]:
    """The reported lines, and the samples (n, 2) [m] of their length; of a circle those inside the picture."""
    segments = np.array([each.ends for each in found.lines], dtype=np.float64).reshape(-1, 2, 2)
    samples = Lines(segments).samples()
    if found.circle is None:
        return Lines(segments), samples
    circles = [(found.circle.center, found.circle.radius)]
    around = Lines(segments[:0], circles).samples()
    return Lines(segments, circles), np.concatenate([samples, around[shown(around)]])
