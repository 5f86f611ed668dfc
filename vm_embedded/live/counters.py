"""Counters and stage times of a running detector, for its status and for Prometheus."""

from __future__ import annotations

import math
import time
from dataclasses import asdict, dataclass

from ..cameras.grabber import Grabber
from ..detection.cache import MeshCache
from ..detection.detections import Detections
from ..detection.pose_state import PoseState
from ..output.channels import Channels
from ..poses.stream import PoseStream
from .prometheus import Histogram, to_prometheus_text
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
