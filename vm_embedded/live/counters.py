"""What a running detector counts and times, as its status and Prometheus get it."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass

from ..cameras.grabber import CameraCounts
from ..detection.cache import MeshCache
from ..detection.detections import Detections
from ..output.messages import STATES
from .prometheus import Histogram, exposition, resident_bytes


@dataclass
class Tally:
    """What became of frames after the camera. late: older than max_age_ms. stale: without a pose. failed: of a wrong
    size, or unanswered. poses came; poses_bad were refused. dropped: lines that slow readers lost."""

    frames: int = 0
    detections: int = 0
    late: int = 0
    stale: int = 0
    failed: int = 0
    poses: int = 0
    poses_bad: int = 0
    dropped: int = 0


_MEANINGS = {
    "frames": "frames that were answered",
    "detections": "objects that were reported",
    "late": "frames that were too old to be reported",
    "stale": "frames for which there was no pose",
    "failed": "frames that could not be answered",
    "poses": "poses that came",
    "poses_bad": "poses that were refused",
    "dropped": "lines that slow readers lost",
    "grabbed": "new frames of the camera",
    "skipped": "frames that gave way to newer ones",
    "broken": "frames that could not be decoded",
    "frozen": "frames that equalled the one before",
    "ahead": "frames from the future",
    "reconnects": "times that the camera was opened again",
    "cache_hits": "frames whose mesh was prepared",
    "cache_misses": "frames whose mesh was not",
}


class Figures:
    """All of them, since the process began."""

    def __init__(self) -> None:
        self.tally = Tally()
        self._stages: dict[str, Histogram] = {}
        self._began = time.monotonic()

    def answered(self, detections: Detections, took: float, age: float) -> None:
        """A frame was answered: it took so long, and was so old then [s]."""
        self.tally.frames += 1
        self.tally.detections += len(detections)
        stages = {name: 1e-3 * value for name, value in detections.timing_ms.items()}
        for name, seconds in {**stages, "answer": took, "age": age}.items():
            self._stages.setdefault(name, Histogram()).add(seconds)

    def counts(self, camera: CameraCounts) -> dict[str, int]:
        """All counts by name."""
        return {**asdict(self.tally), **asdict(camera)}

    def metrics(self, state: str, camera: CameraCounts, cache: MeshCache, since: float) -> str:
        """For Prometheus. since: when the last frame was answered, in monotonic time [s]."""
        now = time.monotonic()
        counts = {**self.counts(camera), "cache_hits": cache.hits, "cache_misses": cache.misses}
        gauges = {
            "frame_age_seconds": ("since a frame was answered last", now - max(since, self._began)),
            "resident_bytes": ("memory of the process", resident_bytes()),
            "uptime_seconds": ("since the process began", now - self._began),
        }
        counters = {name: (_MEANINGS[name], float(value)) for name, value in counts.items()}
        return exposition(counters, gauges, state, STATES, self._stages)
