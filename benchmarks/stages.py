"""Stages of a call on the demo's frames: one thread, warm cache, medians and p99 in milliseconds."""

import os
from pathlib import Path

import numpy as np

from vm_embedded import Detector, Settings, read_lens_file
from vm_embedded.sources import read_image

DEMO = Path(__file__).parents[1] / "tests" / "fixtures" / "demo"
ROUNDS = 100


def main() -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    frames = [
        (read_image(path), read_lens_file(path.with_name(f"lens{path.stem[5:]}.yaml")))
        for path in sorted(DEMO.glob("image*.jpg"))
    ]
    # Interleaved, so that whatever else the machine does meets both.
    detectors = {
        sampling: Detector.from_file(DEMO / "ball.onnx", Settings(sampling=sampling)) for sampling in ("exact", "fast")
    }
    timings: dict[str, list[dict[str, float]]] = {sampling: [] for sampling in detectors}
    points = []
    for number in range(ROUNDS + 1):
        for image, file in frames:
            for sampling, detector in detectors.items():
                assert file.orientation is not None
                found = detector.detect(image, file.orientation, file.lens)
                if number:  # the first round fills the cache
                    timings[sampling].append(found.timing_ms)
                    points.append(len(found.pixels))
    print(f"{len(frames)} frames, median {np.median(points):.0f} points")
    for sampling, rows in timings.items():
        print(
            f"sampling {sampling}: "
            + ", ".join(
                f"{stage} {np.median(values):.2f} (p99 {np.quantile(values, 0.99):.2f})"
                for stage in rows[0]
                for values in [[row[stage] for row in rows]]
            )
        )


if __name__ == "__main__":
    main()
