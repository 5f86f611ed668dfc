"""Scores of field features: goal posts, robots, lines and the border of the field."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats, Mask
from vm_embedded.field.features import FieldFeatures

from .border_scores import BorderScores
from .line_scores import LineScores
from .line_shapes import Lines
from .upright_scores import TrueUpright, UprightScores


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
