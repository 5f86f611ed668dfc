"""Mesh points as places on the plane, with what a network says about a soccer field there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Chosen, Floats, Indices, Mask, Singles

ROLES = ("goal", "robot", "line", "field")
"""Names of the classes that field features are made of."""

COLUMN = 0.04
"""Width of a column of points, as seen from above [rad]."""

_LOWEST = 1e-3
"""Rays less steep than this do not meet the plane near enough to matter."""


@dataclass(frozen=True, eq=False)
class GroundMap:
    """Where rays of a mesh meet the plane. It is the same for all frames with these rays, so it is prepared once.

    All lengths are in heights of the camera over the plane. A point on something that stands on the plane has the
    place behind it, where its ray would end.

    numbers (k,): of the rays that meet the plane, from near to far. places (2, k): where they do, from below the camera
    in the frame of the rays. ranges (k,): their distances from there. leaning (k,): see `leaning`.
    by_column (k,): the same numbers column by column, each from near to far. column_ranges (k,): distances in this
    order. bounds (c + 1,): positions where the columns begin, and k. directions (c,): of the columns, as complex
    numbers of length 1; the first one is behind the camera.
    """

    numbers: Chosen
    places: Floats
    ranges: Floats
    leaning: Singles
    by_column: Chosen
    column_ranges: Floats
    bounds: Chosen
    directions: npt.NDArray[np.complex128]


def ground_map(rays: Floats, numbers: Chosen | Indices) -> GroundMap:
    """The map of rays (m, 3) that point downward, of those with these numbers."""
    upward = rays[numbers, 2]
    order = np.argsort(upward, kind="stable")
    sorted_numbers = numbers[order[: np.searchsorted(upward[order], -_LOWEST)]].astype(np.intp)
    x, y, z = rays[sorted_numbers].T
    places = np.array([x, y]) / -z
    ranges = np.hypot(*places)
    column = np.floor((np.arctan2(places[1], places[0]) + np.pi) / COLUMN).astype(np.intp)
    order = np.argsort(column, kind="stable")
    count = int(2.0 * np.pi / COLUMN) + 1
    return GroundMap(
        sorted_numbers,
        places,
        ranges,
        leaning(ranges).astype(np.float32),
        sorted_numbers[order],
        ranges[order],
        np.searchsorted(column[order], np.arange(count + 1)),
        np.exp(1j * ((np.arange(count) + 0.5) * COLUMN - np.pi)),
    )


@dataclass(frozen=True, eq=False)
class GroundPoints:
    """The points of a frame on the plane.

    map: where the m rays meet the plane. shown (m,): which rays the frame shows. line (m,): probability of a line
    there. inside (m,): probability of the field and its lines, minus that of all that is neither the field nor anything
    on it; None if the network has no class field. height: of the camera over the plane [m]. across: distance between
    neighboring points across the ray [m]; the same everywhere. heading (2, 2): from the frame of the rays to that of
    Detection.
    """

    map: GroundMap
    shown: Mask
    line: Singles
    inside: Singles | None
    height: float
    across: float
    heading: Floats


def leaning(ranges: Floats) -> Floats:
    """The tangent of half the angle between the vertical and rays to places at these ranges (...) [heights of the
    camera]: the way to the next ring of points, less that to the next point of the ring, grows with it and the range.
    """
    return np.asarray(ranges / (np.sqrt(ranges * ranges + 1.0) + 1.0))


def starts_of_runs(numbers: npt.NDArray[np.number[Any]]) -> Chosen:
    """Positions in numbers (n,), at least one, where runs of equal numbers start."""
    return np.flatnonzero(np.concatenate([[True], numbers[1:] != numbers[:-1]]))
