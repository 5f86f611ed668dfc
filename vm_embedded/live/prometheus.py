"""Counters, gauges and histograms in Prometheus's text format."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator, Mapping

from ..detection.pose_state import VERDICTS
from ..output.messages import STATES

_BUCKETS = (0.0005, 0.001, 0.002, 0.003, 0.005, 0.008, 0.012, 0.02, 0.033, 0.05, 0.1, 0.25, 1.0, math.inf)
"""Upper bounds of the histogram buckets [s]."""


_LABELS = {
    "state": ("whether the detector is in a state", STATES),
    "pose": ("whether frames say this about the pose of the camera", VERDICTS),
}
"""Help and values of what is one of several words."""


class Histogram:
    """Counts of durations in each bucket, and their sum [s]."""

    def __init__(self) -> None:
        self.counts = [0] * len(_BUCKETS)
        self.sum = 0.0

    def add(self, seconds: float) -> None:
        """Add a duration [s]."""
        self.counts[bisect_left(_BUCKETS, seconds)] += 1
        self.sum += seconds

    def lines(self, name: str, label: str) -> Iterator[str]:
        """Lines of the text format."""
        total = 0
        for end, count in zip(_BUCKETS, self.counts, strict=True):
            total += count
            upper = "+Inf" if math.isinf(end) else f"{end:g}"
            yield f'{name}_bucket{{{label},le="{upper}"}} {total}'
        yield f"{name}_sum{{{label}}} {self.sum:.9g}"
        yield f"{name}_count{{{label}}} {total}"


def to_prometheus_text(
    counters: Mapping[str, tuple[str, float]],
    gauges: Mapping[str, tuple[str, float]],
    words: Mapping[str, str],
    stages: Mapping[str, Histogram],
) -> str:
    """Format all metrics.

    counters, gauges: help and value by name. words: state and pose. stages: their histograms.
    """
    lines = []
    for kind, values in (("counter", counters), ("gauge", gauges)):
        for name, (help, value) in values.items():
            full = f"vm_{name}{'_total' if kind == 'counter' else ''}"
            lines += [f"# HELP {full} {help}", f"# TYPE {full} {kind}", f"{full} {value:.12g}"]
    for name, word in words.items():
        help, allowed = _LABELS[name]
        lines += [f"# HELP vm_{name} {help}", f"# TYPE vm_{name} gauge"]
        lines += [f'vm_{name}{{{name}="{each}"}} {int(each == word)}' for each in allowed]
    lines += ["# HELP vm_stage_seconds how long each stage of a frame takes", "# TYPE vm_stage_seconds histogram"]
    for stage, histogram in stages.items():
        lines += histogram.lines("vm_stage_seconds", f'stage="{stage}"')
    return "\n".join(lines) + "\n"
