"""Measuring detectors on a walk: the whole call and its stages, with a warm and a cold cache."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from ..arrays import Floats, Image
from ..detection.cache import MeshCache
from ..detection.detector import Detector
from ..geometry.lens import Lens, Size
from ..geometry.orientation import Orientation

_QUANTILES = {"p50": 0.5, "p90": 0.9, "p99": 0.99, "p99.9": 0.999}

_WARM_UP_CALLS = 5
"""Calls that take the costs which a process pays only once."""


@dataclass(frozen=True, eq=False)
class Run:
    """One detector on a walk, arrays with one value per frame.

    stages: time of each stage [ms], as in `Detections.timing_ms`. total: time of the whole call [ms]. points: number of
    mesh points on screen.
    """

    detector: Detector
    stages: Mapping[str, Floats]
    total: Floats
    points: Floats

    def as_dict(self, floor_ns: float | None) -> dict[str, Any]:
        """The run as plain numbers for JSON.

        floor_ns: theoretical minimum time of the network per point [ns]; None if unknown.
        """
        settings, cache = self.detector.settings, self.detector.cache
        points = float(np.median(self.points))
        infer = float(np.median(self.stages["infer"]))
        return {
            "threads": self.detector.session.onnx.threads,
            "spinning": settings.spinning,
            "total_ms": _quantiles(self.total),
            "stages_ms": {
                name: {**_quantiles(values), "share": round(float(values.sum() / self.total.sum()), 3)}
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
    progress: Callable[[int], None] = lambda frames: None,
) -> list[Run]:
    """Run detectors on the same walk, and return one run for each.

    The detectors take turns within each frame, in alternating order, so that other load on the machine affects all of
    them alike. A few warm-up calls are not counted; caches are empty at the first frame.
    progress: called after each frame with the number of frames.
    """
    for detector in detectors:
        for _ in range(_WARM_UP_CALLS):
            detector.detect(image, orientations[0], lens)
        detector.cache = MeshCache(detector.manifest, detector.settings)
    timings: list[list[dict[str, float]]] = [[] for _ in detectors]
    points: list[list[int]] = [[] for _ in detectors]
    for frame, orientation in enumerate(orientations, start=1):
        turns = range(len(detectors))
        for number in turns if frame % 2 else reversed(turns):
            found = detectors[number].detect(image, orientation, lens)
            timings[number].append(found.timing_ms)
            points[number].append(len(found.observation))
            # As vm-detect does between frames.
            detectors[number].prepare_nearby(orientation, lens, (image.shape[1], image.shape[0]))
        progress(frame)
    return [
        Run(
            detector,
            {name: np.array([each[name] for each in rows]) for name in rows[0] if name != "total"},
            np.array([each["total"] for each in rows]),
            np.array(counts, dtype=np.float64),
        )
        for detector, rows, counts in zip(detectors, timings, points, strict=True)
    ]


def measure_cold(detector: Detector, lens: Lens, size: Size, orientations: Sequence[Orientation]) -> dict[str, Any]:
    """Time to prepare an orientation that the cache does not have [ms]: with the mesh of its height, and without."""
    lens = lens.for_image(size)
    new_mesh, known_mesh = [], []
    for orientation in orientations:
        cache = MeshCache(detector.manifest, detector.settings)
        beside = Orientation.from_roll_pitch(
            orientation.height, orientation.roll, orientation.pitch + 2.0 * detector.settings.pitch_step
        )
        new_mesh.append(_milliseconds(partial(cache.view, beside, lens, size)))
        known_mesh.append(_milliseconds(partial(cache.view, orientation, lens, size)))
    return {"bucket_ms": _quantiles(np.array(known_mesh)), "mesh_and_bucket_ms": _quantiles(np.array(new_mesh))}


def _milliseconds(call: Callable[[], object]) -> float:
    """Duration of a call [ms]."""
    started = perf_counter()
    call()
    return 1e3 * (perf_counter() - started)


def _quantiles(milliseconds: Floats) -> dict[str, float]:
    return {name: round(float(np.quantile(milliseconds, share)), 4) for name, share in _QUANTILES.items()}
