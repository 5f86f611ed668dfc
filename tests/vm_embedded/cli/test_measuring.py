"""Runs of detectors on the same walk, and cold calls."""

import numpy as np

from tests.drawn_scenes import MODEL
from vm_embedded import Detector, Orientation, Rectilinear, Settings
from vm_embedded.cli.measuring import measure, measure_cold
from vm_embedded.cli.workload import draw_empty_field, walk


def test_detectors_are_measured_on_every_frame():
    lens = Rectilinear(focal_length=150.0, fov=1.8)
    detectors = [Detector.from_file(MODEL, Settings(cache_mib=cache)) for cache in (16.0, 64.0)]
    steps = walk(Orientation.from_roll_pitch(0.6, 0.0, 0.4), 7)
    runs = measure(detectors, draw_empty_field((320, 240), "bgr"), lens, steps)
    assert [run.detector for run in runs] == detectors
    for each in runs:
        assert len(each.total) == len(each.points) == 7
        assert set(each.stages) == {"mesh", "project", "sample", "infer", "cluster", "field"}
        assert (sum(each.stages.values()) <= each.total).all()
    np.testing.assert_array_equal(runs[0].points, runs[1].points)


def test_cold_calls_are_measured_with_the_mesh_and_without():
    lens = Rectilinear(focal_length=150.0, fov=1.8)
    steps = walk(Orientation.from_roll_pitch(0.6, 0.0, 0.4), 3)
    found = measure_cold(Detector.from_file(MODEL), lens, (320, 240), steps)
    assert 0 < found["bucket_ms"]["p50"] <= found["bucket_ms"]["p99"]
    assert found["mesh_and_bucket_ms"]["p50"] > 0
