"""Times calls in turns, so disturbances of the machine affect all of them alike.

Each turn makes a call several times in a row. The first one finds the processor's caches as another call left them; the
others find them as the same call left them. Both are reported.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter

import numpy as np


def interleaved(
    calls: Mapping[str, Callable[[], object]], rounds: int, row: int | Mapping[str, int] = 2, warm: int = 2
) -> dict[str, dict[str, float]]:
    """Times of each call, which is made `row` times in each turn [ms]: p50 and p99 of all but the first of a row, and
    `first`, the p50 of the first ones. row: one number, or one for each call. The first `warm` turns don't count."""
    times: dict[str, list[list[float]]] = {name: [] for name in calls}
    for number in range(rounds + warm):
        for name, call in calls.items():
            rows = []
            for _ in range(row if isinstance(row, int) else row[name]):
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
