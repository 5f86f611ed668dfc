"""Counters and stage times of a running detector, for its status and for Prometheus."""

from __future__ import annotations

import math
import time
from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass

from ..cameras.grabber import Grabber
from ..detection.cache import MeshCache
from ..detection.detections import Detections
from ..detection.pose_state import VERDICTS, PoseState
from ..output.channels import Channels
from ..output.messages import STATES
from ..poses.stream import PoseStream
from .system import resident_bytes


@dataclass
class Outcomes:
    """Counts of what happened to frames after the camera; _HELP has the meanings."""

    frames: int = 0
    detections: int = 0
    late: int = 0
    stale: int = 0
    failed: int = 0


_HELP = {
    "frames": "frames in which objects were searched and reported",
    "detections": "objects that were reported",
    "late": "frames that were too old to be reported",
    "stale": "frames without a matching pose",
    "failed": "frames of a wrong size, or with an error in the detection",
    "poses": "poses that were accepted",
    "poses_bad": "poses that were rejected",
    "dropped": "messages that slow readers lost",
    "grabbed": "new frames of the camera",
    "skipped": "frames replaced by a newer frame before they were used",
    "broken": "frames that could not be decoded",
    "frozen": "frames identical to the one before",
    "ahead": "frames with a time in the future",
    "reconnects": "times that the camera was opened again",
    "cache_hits": "frames whose mesh was in the cache",
    "cache_misses": "frames whose mesh had to be prepared",
    "cache_prepared": "meshes that were prepared between frames",
}


class Counters:
    """All counters and stage times since the process started, also those that grabber, poses and outputs count."""

    def __init__(self, grabber: Grabber, poses: PoseStream, outputs: Channels) -> None:
        self.outcomes = Outcomes()
        self._grabber, self._poses, self._outputs = grabber, poses, outputs
        self._stages: dict[str, Histogram] = {}
        self._started = time.monotonic()

    def add_answer(self, detections: Detections, duration: float, age: float) -> None:
        """Count an answered frame: how long the answer took, and how old the frame was at its end [s]."""
        self.outcomes.frames += 1
        self.outcomes.detections += len(detections)
        stages = {name: 1e-3 * value for name, value in detections.timing_ms.items()}
        for name, seconds in {**stages, "answer": duration, "age": age}.items():
            self._stages.setdefault(name, Histogram()).add(seconds)

    def counts(self) -> dict[str, int]:
        """All counts by name."""
        poses = {"poses": self._poses.received, "poses_bad": self._poses.bad}
        return {**asdict(self.outcomes), **poses, "dropped": self._outputs.dropped, **asdict(self._grabber.counts)}

    def metrics(self, state: str, cache: MeshCache, answered: float, pose: PoseState) -> str:
        """All metrics in Prometheus's text format. answered: monotonic time of the last answered frame [s]."""
        now = time.monotonic()
        cached = {"cache_hits": cache.hits, "cache_misses": cache.misses, "cache_prepared": cache.prepared}
        gauges = {
            "frame_age_seconds": ("time since the last frame was answered", now - max(answered, self._started)),
            "resident_bytes": ("memory of the process", resident_bytes()),
            "uptime_seconds": ("time since the process started", now - self._started),
            **_pose_errors(pose),
        }
        counters = {name: (_HELP[name], float(value)) for name, value in {**self.counts(), **cached}.items()}
        return to_prometheus_text(counters, gauges, {"state": state, "pose": pose.verdict}, self._stages)


def _pose_errors(pose: PoseState) -> dict[str, tuple[str, float]]:
    """Help and value of the metrics of the pose; NaN is what frames do not show."""
    errors = {
        "pose_pitch_error_degrees": ("true minus assumed pitch, as frames show it", pose.pitch),
        "pose_roll_error_degrees": ("true minus assumed roll, as frames show it", pose.roll),
        "pose_height_error_percent": ("how much larger the true height is than the assumed one", pose.height),
    }
    return {name: (help, math.nan if value is None else value) for name, (help, value) in errors.items()}


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
