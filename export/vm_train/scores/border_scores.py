"""Scores of the field's border: how far off the reported border is, in all directions that show the true one.

Distances are on the plane, from the camera's foot. Scores without a value are NaN, never 0; `as_dict` writes None.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats, Mask
from vm_embedded.errors import InputError

from .curves import ratio, without_nan
from .distance_bins import bins_of, checked_edges, named_bins
from .upright_scores import FIELD_EDGES


class BorderScores:
    """Scores of the borders in all pictures so far. They are exact: it keeps two numbers of every direction.

    unasked: number of pictures that report a border although the picture shows none. edges (D + 1,) [m]: bins include
    their lower edge. Raises InputError for edges that do not rise.
    """

    def __init__(self, edges: Floats = FIELD_EDGES) -> None:
        self.edges = checked_edges(edges)
        self.pictures = 0
        self.unasked = 0
        self._directions: list[Floats] = []  # (b, 2): true distance, and relative error or NaN

    def add(self, directions: Floats, distances: Floats, reported: Floats | None) -> None:
        """Add a picture.

        directions (b,) [rad]: around the camera's foot, counterclockwise from x. distances (b,) [m]: of the true border
        there. reported (m, 2) [m]: a polyline, or None.
        """
        found = np.full(len(directions), np.nan) if reported is None else distances_along(reported, directions)
        self._directions.append(np.column_stack([distances, np.abs(found - distances) / distances]))
        self.unasked += reported is not None and not len(directions)
        self.pictures += 1

    def __add__(self, other: BorderScores) -> BorderScores:
        """Scores of the pictures of both. Raises InputError if their distance bins differ."""
        if not np.array_equal(self.edges, other.edges):
            raise InputError("scores with different distance bins do not add up")
        both = BorderScores(self.edges)
        both.pictures, both.unasked = self.pictures + other.pictures, self.unasked + other.unasked
        both._directions = self._directions + other._directions
        return both

    def row(self, distance_bin: int | None = None) -> dict[str, Any]:
        """Numbers of a distance bin, from 0, or of all distances."""
        table = np.concatenate([np.zeros((0, 2)), *self._directions])
        if distance_bin is not None:
            table = table[_in_bin(table[:, 0], self.edges, distance_bin)]
        errors = table[:, 1][~np.isnan(table[:, 1])]
        values = {
            "reported_share": ratio(len(errors), len(table)),
            "error_median": float(np.median(errors)) if len(errors) else math.nan,
            "error_p90": float(np.quantile(errors, 0.9)) if len(errors) else math.nan,
        }
        return {"directions": len(table), **without_nan(values)}

    def as_dict(self) -> dict[str, Any]:
        """All numbers, for JSON: over all distances and in each bin."""
        bins = {name: self.row(number) for name, number in named_bins(self.edges).items()}
        return {"pictures": self.pictures, "unasked": self.unasked, **bins}


def distances_along(polyline: Floats, directions: Floats) -> Floats:
    """Distances (b,) [m] from the origin to a polyline (m, 2) in directions (b,) [rad]; NaN where it is not.

    Where it crosses a direction twice, the larger distance counts.
    """
    unit = np.stack([np.cos(directions), np.sin(directions)], axis=-1)
    farthest = np.full(len(directions), -np.inf)
    for start, end in pairwise(polyline):
        left, right = _cross(unit, start), _cross(unit, end)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = left / (left - right)
        along = unit @ start + share * (unit @ (end - start))
        meets = (left * right <= 0.0) & (left != right) & (along > 0.0)
        np.maximum(farthest, np.where(meets, along, -np.inf), out=farthest)
    return np.where(farthest > 0.0, farthest, np.nan)


def _cross(units: Floats, point: Floats) -> Floats:
    return np.asarray(units[:, 0] * point[1] - units[:, 1] * point[0])


def _in_bin(distances: Floats, edges: Floats, number: int) -> Mask:
    return np.asarray(bins_of(distances, edges) == number)
