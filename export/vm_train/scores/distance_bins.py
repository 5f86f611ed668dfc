"""Distance bins, for scores by distance."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError

DISTANCE_EDGES: Floats = np.linspace(0.0, 10.0, 21)
"""Edges of distance bins [m], up to the largest distance in the paper's figures."""


def checked_edges(edges: Floats) -> Floats:
    """A copy of the edges (D + 1,) [m]. Raises InputError unless there are two or more, and they rise."""
    copy = np.array(edges, dtype=np.float64)
    if copy.ndim != 1 or len(copy) < 2 or not np.isfinite(copy).all() or not (np.diff(copy) > 0.0).all():
        raise InputError(f"distance edges must be two or more rising numbers [m], not {np.asarray(edges).tolist()}")
    return copy


def bins_of(distances: Floats, edges: Floats) -> npt.NDArray[np.intp]:
    """Bin numbers (n,) of distances (n,) between edges (D + 1,), from 0; D for distances outside all bins and for NaN.

    A bin includes its lower edge.
    """
    bins = np.searchsorted(edges, distances, side="right") - 1
    return np.where(bins < 0, len(edges) - 1, bins)


def named_bins(edges: Floats) -> dict[str, int | None]:
    """Bin numbers by name: None for `all` distances together, and a number for each bin, such as `0.5-1`."""
    return {"all": None} | {f"{low:g}-{high:g}": number for number, (low, high) in enumerate(pairwise(edges.tolist()))}
