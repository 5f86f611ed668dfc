"""What a frame shows of the field. All places are on the observation plane, in its frame, as in Detection."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats, Singles

UPRIGHTS = {"goal": "post", "robot": "robot"}
"""What the uprights of a class are, by its name."""


@dataclass(frozen=True, eq=False)
class Upright:
    """Something that stands on the plane: a goal post, or a robot or another obstacle.

    class_name: post or robot. position (2,) [m]: its base, which is the middle of a post's foot, or the front of a
    robot's foot, in the direction of its middle. distance [m]: from the camera to the base. bearing (3,): unit vector
    from the camera to the base. pixel (2,) [px]: of the base; NaN outside of the picture. width [m]: as seen from the
    camera. confidence: calibrated probability, 0 to 1.
    """

    class_name: str
    position: Floats
    distance: float
    bearing: Floats
    pixel: Floats
    width: float
    confidence: float

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "class": self.class_name,
            "confidence": round(self.confidence, 3),
            "position": _rounded(self.position, 3),
            "distance": round(self.distance, 3),
            "bearing": _rounded(self.bearing, 4),
            "pixel": _rounded(self.pixel, 1),
            "width": round(self.width, 3),
        }


@dataclass(frozen=True, eq=False)
class Segment:
    """A straight piece of a field line: its middle line. ends (2, 2) [m]. pixels (2, 2) [px]: of the ends; NaN outside
    of the picture. confidence: mean probability of its points, 0 to 1."""

    ends: Floats
    pixels: Floats
    confidence: float

    @property
    def length(self) -> float:
        """Distance between the ends [m]."""
        return float(np.hypot(*(self.ends[1] - self.ends[0])))

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "ends": [_rounded(each, 3) for each in self.ends],
            "pixels": [_rounded(each, 1) for each in self.pixels],
            "confidence": round(self.confidence, 3),
        }


@dataclass(frozen=True, eq=False)
class CenterCircle:
    """The center circle. center (2,) [m]. radius [m]: of the middle of its line. arc [rad]: how much of it is seen.
    confidence: mean probability of its points, 0 to 1."""

    center: Floats
    radius: float
    arc: float
    confidence: float

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "center": _rounded(self.center, 3),
            "radius": round(self.radius, 3),
            "arc": round(self.arc, 2),
            "confidence": round(self.confidence, 3),
        }


@dataclass(frozen=True, eq=False)
class Crossing:
    """Where two field lines meet at a right angle.

    kind: L, T or X. position (2,) [m]. heading [rad]: counterclockwise from the x axis; for T the direction of the line
    that ends there, away from the crossing; for L halfway between its two lines, into the corner; for X the direction
    of either line, from 0 to a right angle. confidence: product of those of its two lines, and down to half of it if
    one ends in front of the crossing; 0 to 1.
    """

    kind: str
    position: Floats
    heading: float
    confidence: float

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "kind": self.kind,
            "position": _rounded(self.position, 3),
            "heading": round(self.heading, 3),
            "confidence": round(self.confidence, 3),
        }


@dataclass(frozen=True, eq=False)
class Border:
    """The visible border of the field: a convex polyline from right to left; if parts of it are hidden or too far, the
    longest part. points (m, 2) [m]. pixels (m, 2) [px]."""

    points: Floats
    pixels: Floats

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "points": [_rounded(each, 3) for each in self.points],
            "pixels": [_rounded(each, 1) for each in self.pixels],
        }


@dataclass(frozen=True, eq=False)
class FieldFeatures:
    """All that a frame shows of the field; empty where the network has no class for it.

    posts: goal posts, nearest first. goals: pairs of indices in `posts`, the left post of each goal first, as seen
    from the camera. robots: robots and other obstacles, nearest first. lines: straight pieces of lines. circle: the
    center circle, or None. crossings: of lines. line_points (p, 2) [m]: thinned points on lines, with line_confidences
    (p,). border: None if the picture does not show it.
    """

    posts: tuple[Upright, ...]
    goals: tuple[tuple[int, int], ...]
    robots: tuple[Upright, ...]
    lines: tuple[Segment, ...]
    circle: CenterCircle | None
    crossings: tuple[Crossing, ...]
    line_points: Floats
    line_confidences: Singles
    border: Border | None

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON, without the line points: a few kilobytes at most."""
        return {
            "posts": [each.as_dict() for each in self.posts],
            "goals": [list(each) for each in self.goals],
            "robots": [each.as_dict() for each in self.robots],
            "lines": [each.as_dict() for each in self.lines],
            "circle": None if self.circle is None else self.circle.as_dict(),
            "crossings": [each.as_dict() for each in self.crossings],
            "border": None if self.border is None else self.border.as_dict(),
        }


def _rounded(values: Floats, digits: int) -> list[float | None]:
    """Rounded numbers; None, JSON's null, for NaN: the pixel of a place outside of the picture."""
    return [round(each, digits) if math.isfinite(each) else None for each in values.tolist()]
