"""What a frame shows of the field. All places are on the observation plane, in its frame, as in Detection."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from ..arrays import Floats, Singles
from ..borders.records import SHARE, SIZE, Record, Sent
from .ridge_edges import Ridges

_PLACE = Sent(3, (2,))


@dataclass(frozen=True, eq=False)
class Upright(Record):
    """Something that stands on the plane: a goal post, or a robot or another obstacle.

    class_name: post or robot. confidence: calibrated probability of a close look; if the class has none, the
    probability of a peak; if it has no peaks either, the mean probability of its points; 0 to 1. position (2,) [m]: its
    base, which is the middle of a post's foot, or the front of a robot's foot, in the direction of its middle. distance
    [m]: from the camera to the base. bearing (3,): unit vector from the camera to the base. pixel (2,) [px]: of the
    base; NaN outside of the picture. width [m]: as seen from the camera.
    """

    class_name: Annotated[str, Sent(name="class")]
    confidence: Annotated[float, SHARE]
    position: Annotated[Floats, _PLACE]
    distance: Annotated[float, SIZE]
    bearing: Annotated[Floats, Sent(4, (3,))]
    pixel: Annotated[Floats, Sent(1, (2,), null=True)]
    width: Annotated[float, SIZE]


@dataclass(frozen=True, eq=False)
class Segment(Record):
    """A straight piece of a field line: its middle line.

    ends (2, 2) [m]: both ends on the plane. pixels (2, 2) [px]: of the ends; NaN outside of the picture. confidence:
    mean probability of its points, 0 to 1.
    """

    ends: Annotated[Floats, Sent(3, (2, 2))]
    pixels: Annotated[Floats, Sent(1, (2, 2), null=True)]
    confidence: Annotated[float, SHARE]

    @property
    def length(self) -> float:
        """Distance between the ends [m]."""
        return math.dist(*self.ends.tolist())


@dataclass(frozen=True, eq=False)
class CenterCircle(Record):
    """The center circle.

    center (2,) [m]: on the plane. radius [m]: of the middle of its line. arc [rad]: how much of it is seen. confidence:
    mean probability of its points, 0 to 1.
    """

    center: Annotated[Floats, _PLACE]
    radius: Annotated[float, SIZE]
    arc: Annotated[float, Sent(2, least=0)]
    confidence: Annotated[float, SHARE]

    @property
    def outline(self) -> Floats:
        """Points (97, 2) [m] around the circle, the last as the first."""
        angles = np.linspace(0.0, 2.0 * np.pi, 97)
        return np.asarray(self.center + self.radius * np.column_stack([np.cos(angles), np.sin(angles)]))


@dataclass(frozen=True, eq=False)
class Crossing(Record):
    """Where two field lines meet at a right angle.

    kind: its form. position (2,) [m]: on the plane. heading [rad]: counterclockwise from the x axis; for T the
    direction of the line that ends there, away from the crossing; for L halfway between its two lines, into the corner;
    for X the direction of either line, from 0 to a right angle. confidence: product of those of its two lines, and down
    to half of it if one ends in front of the crossing; 0 to 1.
    """

    kind: Annotated[str, Sent(allowed=("L", "T", "X"))]
    position: Annotated[Floats, _PLACE]
    heading: Annotated[float, Sent()]
    confidence: Annotated[float, SHARE]


@dataclass(frozen=True, eq=False)
class Border(Record):
    """The visible border of the field: a convex polyline from right to left; if parts of it are hidden or too far, the
    longest part.

    points (m, 2) [m]: on the plane. pixels (m, 2) [px]: of the points.
    """

    points: Annotated[Floats, Sent(3, (-1, 2))]
    pixels: Annotated[Floats, Sent(1, (-1, 2), null=True)]


@dataclass(frozen=True, eq=False)
class FieldFeatures(Record):
    """All that a frame shows of the field; empty where the network has no class for it.

    posts: goal posts, nearest first. goals (k, 2): pairs of indices in `posts`, from 0; the left post of each goal
    first, as seen from the camera. robots: robots and other obstacles, nearest first. lines: straight pieces of the
    field lines, longest first; a line may have several. circle: the center circle, if the picture shows it. crossings:
    where two lines meet at a right angle. line_points (p, 2) [m]: thinned points on lines, with line_confidences (p,).
    border: the visible border, if the picture shows it. ridges: the lines in the picture, to measure them.
    """

    posts: Annotated[tuple[Upright, ...], Sent()]
    goals: Annotated[tuple[tuple[int, int], ...], Sent(0, (-1, 2), least=0)]
    robots: Annotated[tuple[Upright, ...], Sent()]
    lines: Annotated[tuple[Segment, ...], Sent()]
    circle: Annotated[CenterCircle | None, Sent(null=True)]
    crossings: Annotated[tuple[Crossing, ...], Sent()]
    line_points: Floats
    line_confidences: Singles
    border: Annotated[Border | None, Sent(null=True)]
    ridges: Ridges | None = None
