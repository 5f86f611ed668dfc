"""Calls timed in turns, so that whatever else the machine does meets all of them.

Each turn makes a call twice. The first one finds in the processor's caches what the call before it left there; the
second one is what a call costs that follows its like. Both are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter

import numpy as np


def interleaved(calls: Mapping[str, Callable[[], object]], rounds: int, warm: int = 3) -> dict[str, dict[str, float]]:
    """Of each call: p50 and p99 of its second time, and p50 of its first, `first` [ms]."""
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in calls}
    for number in range(rounds + warm):
        for name, call in calls.items():
            started = perf_counter()
            call()
            between = perf_counter()
            call()
            ended = perf_counter()
            if number >= warm:
                times[name].append((1e3 * (between - started), 1e3 * (ended - between)))
    found = {}
    for name, pairs in times.items():
        first, second = np.array(pairs).T
        found[name] = {**summary(second), "first": round(float(np.median(first)), 4)}
    return found


def summary(milliseconds: np.ndarray) -> dict[str, float]:
    """Median and p99 [ms]."""
    return {"p50": round(float(np.median(milliseconds)), 4), "p99": round(float(np.quantile(milliseconds, 0.99)), 4)}
