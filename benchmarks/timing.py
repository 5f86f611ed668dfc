"""Calls timed in turns, so that whatever else the machine does meets all of them.

Each turn makes a call several times in a row. The first one finds in the processor's caches what the call before it
left there; the others are what a call costs that follows its like. Both are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter

import numpy as np


def interleaved(
    calls: Mapping[str, Callable[[], object]], rounds: int, row: int = 2, warm: int = 2
) -> dict[str, dict[str, float]]:
    """Of each call, made `row` times in a row in each turn: p50 and p99 of all but the first of a row, and p50 of the
    first ones, `first` [ms]. The first `warm` turns don't count."""
    times: dict[str, list[list[float]]] = {name: [] for name in calls}
    for number in range(rounds + warm):
        for name, call in calls.items():
            rows = []
            for _ in range(row):
                started = perf_counter()
                call()
                rows.append(1e3 * (perf_counter() - started))
            if number >= warm:
                times[name].append(rows)
    found = {}
    for name, rows in times.items():
        values = np.array(rows)
        found[name] = {**summary(values[:, 1:]), "first": round(float(np.median(values[:, 0])), 4)}
    return found


def summary(milliseconds: np.ndarray) -> dict[str, float]:
    """Median and p99 [ms]."""
    return {"p50": round(float(np.median(milliseconds)), 4), "p99": round(float(np.quantile(milliseconds, 0.99)), 4)}
