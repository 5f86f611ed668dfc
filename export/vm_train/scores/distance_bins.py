"""Bins of distance, by which all scores are told apart."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError

DISTANCE_EDGES: Floats = np.linspace(0.0, 10.0, 21)
"""Edges of distance bins [m], as far as the paper's figures go."""


def checked_edges(edges: Floats) -> Floats:
    """A copy of the edges (D + 1,). Raises InputError unless they are two or more rising numbers."""
    copy = np.array(edges, dtype=np.float64)
    if copy.ndim != 1 or len(copy) < 2 or not np.isfinite(copy).all() or not (np.diff(copy) > 0.0).all():
        raise InputError(f"edges of distances must be two or more rising numbers [m], not {np.asarray(edges).tolist()}")
    return copy


def bins_of(distances: Floats, edges: Floats) -> npt.NDArray[np.intp]:
    """Bins (n,) of distances (n,) between edges (D + 1,), counted from 0; D for those in none, as NaN.

    Bins include their lower edge.
    """
    bins = np.searchsorted(edges, distances, side="right") - 1
    return np.where(bins < 0, len(edges) - 1, bins)


def named_bins(edges: Floats) -> dict[str, int | None]:
    """Names of all distances together, `all`, and of each bin, as `0.5-1`, with the bins' numbers."""
    return {"all": None} | {f"{low:g}-{high:g}": number for number, (low, high) in enumerate(pairwise(edges.tolist()))}
