"""How fast a detector is on this machine: the whole call and its stages while a robot walks, warm and cold."""

from __future__ import annotations

import math
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import cv2
import numpy as np

from ..arrays import Floats, Image
from ..detection.cache import MeshCache
from ..detection.detector import Detector
from ..geometry.lens import Lens, Size
from ..geometry.orientation import Orientation
from ..network.session import RUNTIME_VERSION

STAGES = ("mesh", "project", "sample", "infer", "cluster")

_QUANTILES = {"p50": 0.5, "p90": 0.9, "p99": 0.99, "p99.9": 0.999}

_FRAME_RATE, _STRIDE, _STEPS = 30.0, 0.97, 2.02
"""Frames and strides for each second of a walk, and steps for each stride: nothing comes back exactly where it was."""


_WARM = 5
"""Calls that pay for what a process does only once."""


def walk(middle: Orientation, swing: float, sway: float, frames: int) -> list[Orientation]:
    """Orientations of a robot that walks, 30 for each second.

    Its roll swings by `swing` [rad] to both sides about once a second, pitch and height (by `sway` [m]) about twice.
    The two drift against each other, so that no two frames are the same.
    """
    phases = 2.0 * np.pi * _STRIDE / _FRAME_RATE * np.arange(frames)
    return [
        Orientation.from_roll_pitch(
            middle.height + sway * math.sin(_STEPS * phase),
            middle.roll + swing * math.sin(phase),
            middle.pitch + swing * math.cos(_STEPS * phase),
        )
        for phase in phases.tolist()
    ]


def drawn_image(size: Size, format: str) -> Image:
    """A frame of a quiet field, where the user has none at hand: uint8 (height, width[, channels])."""
    random = np.random.default_rng(0)
    field = np.full((size[1], size[0], 3), (60, 110, 50), dtype=np.uint8)
    field = np.asarray(cv2.add(field, random.integers(0, 12, field.shape, dtype=np.uint8)), dtype=np.uint8)
    if format in ("bgra", "rgba"):
        return np.dstack([field, np.full(field.shape[:2], 255, dtype=np.uint8)])
    return field if format in ("bgr", "rgb") else np.ascontiguousarray(field[:, :, 1])


@dataclass(frozen=True, eq=False)
class Run:
    """What one detector took over a walk: milliseconds of each stage and in all for each frame, and its points."""

    detector: Detector
    stages: Mapping[str, Floats]
    total: Floats
    points: Floats

    def as_dict(self, floor_ns: float | None) -> dict[str, Any]:
        """Plain numbers [ms] for JSON. floor_ns: the least time that a point can take, or None if unknown."""
        settings, cache = self.detector.settings, self.detector.cache
        points = float(np.median(self.points))
        infer = float(np.median(self.stages["infer"]))
        return {
            "threads": self.detector.session.threads,
            "spinning": settings.spinning,
            "sampling": settings.sampling,
            "total_ms": _summary(self.total),
            "stages_ms": {
                name: {**_summary(values), "share": round(float(values.sum() / self.total.sum()), 3)}
                for name, values in self.stages.items()
            },
            "points": round(points),
            "points_per_s": round(float(self.points.sum() / (1e-3 * self.total.sum()))),
            "floor_ms": None if floor_ns is None else round(1e-6 * floor_ns * points, 4),
            "infer_over_floor": None if not floor_ns or not points else round(1e6 * infer / (floor_ns * points), 1),
            "hit_rate": round(cache.hit_rate, 4),
            "cache_mib": round(cache.nbytes / 2**20, 1),
        }


def measure(
    detectors: Sequence[Detector],
    image: Image,
    lens: Lens,
    orientations: Sequence[Orientation],
    done: Callable[[int], None] = lambda frames: None,
) -> list[Run]:
    """Run detectors over the same walk, frame by frame in turns, so that whatever else happens meets all of them.

    Every other frame they take turns in the opposite order. A few calls before don't count; the caches are empty again
    at the first frame. `done` is told the number of frames after each.
    """
    for detector in detectors:
        for _ in range(_WARM):
            detector.detect(image, orientations[0], lens)
        detector.cache = MeshCache(detector.manifest, detector.settings)
    timings: list[list[dict[str, float]]] = [[] for _ in detectors]
    points: list[list[int]] = [[] for _ in detectors]
    for frame, orientation in enumerate(orientations, start=1):
        turns = range(len(detectors))
        for number in turns if frame % 2 else reversed(turns):
            found = detectors[number].detect(image, orientation, lens)
            timings[number].append(found.timing_ms)
            points[number].append(int(found.projected.on_screen.sum()))
        done(frame)
    return [
        Run(
            detector,
            {name: np.array([each[name] for each in rows]) for name in STAGES},
            np.array([each["total"] for each in rows]),
            np.array(counts, dtype=np.float64),
        )
        for detector, rows, counts in zip(detectors, timings, points, strict=True)
    ]


def cold(detector: Detector, lens: Lens, size: Size, orientations: Sequence[Orientation]) -> dict[str, Any]:
    """Milliseconds that an orientation costs which the cache does not know: with its height's mesh, and without."""
    lens = lens.for_image(size)
    new_mesh, known_mesh = [], []
    for orientation in orientations:
        cache = MeshCache(detector.manifest, detector.settings)
        beside = Orientation.from_roll_pitch(
            orientation.height, orientation.roll, orientation.pitch + 2.0 * detector.settings.pitch_step
        )
        new_mesh.append(_milliseconds(lambda c=cache, o=beside: c.view(o, lens, size)))  # type: ignore[misc]
        known_mesh.append(_milliseconds(lambda c=cache, o=orientation: c.view(o, lens, size)))  # type: ignore[misc]
    return {"bucket_ms": _summary(np.array(known_mesh)), "mesh_and_bucket_ms": _summary(np.array(new_mesh))}


def _milliseconds(call: Callable[[], object]) -> float:
    started = perf_counter()
    call()
    return 1e3 * (perf_counter() - started)


def _summary(milliseconds: Floats) -> dict[str, float]:
    return {name: round(float(np.quantile(milliseconds, share)), 4) for name, share in _QUANTILES.items()}


_SGEMM = """
import time
import numpy
a = numpy.random.default_rng(0).random((768, 768), dtype=numpy.float32)
best = 1e9
for _ in range(20):
    started = time.perf_counter()
    a @ a
    best = min(best, time.perf_counter() - started)
print(2 * 768**3 / best)
"""


def sgemm_rate() -> float:
    """Multiplications and additions [1/s] of single-precision matrix products on one core: numpy's, in a process of
    its own, because the number of its threads is fixed once it is loaded."""
    one = dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BLIS_NUM_THREADS"), "1")
    done = subprocess.run(
        [sys.executable, "-c", _SGEMM], env={**os.environ, **one}, capture_output=True, text=True, check=True
    )
    return float(done.stdout)


def rss_mib() -> float:
    """Memory that this process holds [MiB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def machine() -> dict[str, Any]:
    """What the figures were measured on."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    flags = next((line.split() for line in lines if line.startswith("flags")), [])
    return {
        "processor": names[0] if names else platform.processor(),
        "cores": len(os.sched_getaffinity(0)),
        "vectors": next((each for each in ("avx512f", "avx2", "avx", "sse4_2") if each in flags), "unknown"),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "opencv": cv2.__version__,
        "onnxruntime": RUNTIME_VERSION,
    }
