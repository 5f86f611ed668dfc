"""The example with its answer that a model file contains, and that each loading runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Indices, Singles
from ..errors import ModelError

_FARTHEST = 4096
"""Largest column and row of a point on a lattice."""


@dataclass(frozen=True, eq=False)
class SelfTest:
    """A small graph and the network's answer: points (n + 1, 3), neighbors (n + 1, N), probabilities (n + 1, outputs).

    The last row is the off-screen point. With peaks, their outputs follow the probabilities of the classes. cells (n,
    2): columns and rows of points on a lattice, as in Mesh, else None.
    """

    points: Singles
    neighbors: Indices
    probabilities: Singles
    cells: Indices | None = None

    def __len__(self) -> int:
        return len(self.points) - 1

    def as_dict(self) -> dict[str, Any]:
        """Nested lists for JSON, with as many digits as the check needs."""
        return {
            "points": np.round(self.points.astype(float), 4).tolist(),
            "neighbors": self.neighbors.tolist(),
            "probabilities": np.round(self.probabilities.astype(float), 6).tolist(),
            "cells": None if self.cells is None else self.cells.tolist(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> SelfTest:
        """Inverse of `as_dict`. Raises ModelError for data that don't fit together."""
        try:
            test = cls(
                np.array(data["points"], dtype=np.float32),
                _indices(data["neighbors"]),
                np.array(data["probabilities"], dtype=np.float32),
                None if data["cells"] is None else _indices(data["cells"]).reshape(-1, 2),
            )
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise ModelError(f"self-test in the model file can't be read: {error}") from error
        rows = len(test.points) if test.points.ndim == 2 else 0
        if rows < 1 or test.points.shape != (rows, 3) or test.neighbors.ndim != 2 or test.probabilities.ndim != 2:
            raise ModelError("self-test in the model file has arrays of the wrong shape")
        if len(test.neighbors) != rows or len(test.probabilities) != rows:
            raise ModelError("self-test in the model file has arrays of different lengths")
        if test.neighbors.size and not 0 <= test.neighbors.min() <= test.neighbors.max() < rows:
            raise ModelError("self-test in the model file has neighbors outside of its points")
        if test.cells is not None:
            most = abs(test.cells).max(initial=0)
            if len(test.cells) != rows - 1 or most > _FARTHEST or len(np.unique(test.cells, axis=0)) != rows - 1:
                raise ModelError(
                    "self-test in the model file has cells that are too far out, repeated, or not one for each point"
                )
        return test


def _indices(values: Any) -> Indices:
    """Whole numbers of nested lists. Raises OverflowError for too large ones, whose high bits numpy 1 would cut off."""
    found, limits = np.array(values, dtype=np.int64), np.iinfo(np.int32)
    if found.size and (found.min() < limits.min or found.max() > limits.max):
        raise OverflowError("an index is too large")
    return found.astype(np.int32)
