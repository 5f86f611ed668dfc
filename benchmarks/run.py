"""All figures of docs/performance.md: `make bench`. On one pinned core; compared calls take turns.

Writes benchmarks/results.json. --quick makes fewer rounds, for a check that it works.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from itertools import product, zip_longest
from pathlib import Path
from time import perf_counter
from typing import Any

import cv2
import numpy as np

from vm_embedded import Detector, Orientation, Settings
from vm_embedded.cli.bench import describe_machine, rss_mib, sgemm_rate
from vm_embedded.cli.measuring import measure, measure_cold
from vm_embedded.cli.workload import walk
from vm_embedded.detection.cache import MeshCache
from vm_embedded.detection.projection import project
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.network.bundled import DEFAULT, SHIPPED, model_path
from vm_embedded.network.choose_layout import choose_layout
from vm_embedded.network.model_file import ModelFile
from vm_export.network import Network

from .frames import Frame, demo_frames, frames
from .networks import NETWORKS, NumpyLoop, checkpoint, model_file
from .peers.networks import PEERS, PeerDetector
from .timing import interleaved, summary

RESULTS = Path(__file__).with_name("results.json")
SOAK_FRAMES = 200_000


class Models:
    """The networks of NETWORKS, as files in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.networks: dict[str, Network] = {}
        self._files: dict[str, ModelFile] = {}
        for name, (shape, intersections, max_distance) in NETWORKS.items():
            made = checkpoint(shape, intersections, max_distance)
            self.networks[name] = made.network
            self._files[name] = model_file(made, folder / f"{name}.onnx")

    def detector(self, name: str, **settings: Any) -> Detector:
        return Detector(self._files[name], Settings(**settings))

    def other(self, name: str, intersections: float, max_distance: float, **settings: Any) -> Detector:
        """The same network on another mesh."""
        made = checkpoint(NETWORKS[name][0], intersections, max_distance)
        return Detector(model_file(made, self.folder / "other.onnx"), Settings(**settings))


def mesh_on_screen(detector: Detector, frame: Frame) -> Mesh:
    """The visible part of the mesh at a frame's own height."""
    manifest = detector.manifest
    mesh = manifest.model.build(
        manifest.mesh_shape, frame.orientation.height, manifest.intersections, manifest.max_distance
    )
    seen = project(mesh, frame.orientation.level, frame.lens.for_image(frame.size), frame.size)
    return mesh.part(np.flatnonzero(seen.on_screen))


def session_call(detector: Detector, mesh: Mesh) -> Callable[[], object]:
    """A call of the network alone on a mesh, with prepared inputs."""
    layout = choose_layout(mesh, detector.manifest)
    colors = np.random.default_rng(0).random((3, len(mesh)), dtype=np.float32)
    feeds = layout.feeds(colors, np.ones(len(mesh), dtype=bool))
    model = detector.session.onnx
    return lambda: model.run(feeds)


def numpy_call(network: Network, mesh: Mesh) -> Callable[[], object]:
    loop = NumpyLoop(network, len(mesh))
    points = np.random.default_rng(0).random((len(mesh) + 1, 3), dtype=np.float32)
    itself = np.arange(len(mesh) + 1, dtype=np.intp)[:, None]
    neighbors = np.concatenate([itself, mesh.neighbors], axis=1)
    return lambda: loop.run(points, neighbors)


def sessions(models: Models, work: list[Frame], rounds: int) -> dict[str, Any]:
    """Graph and numpy loop, session only, for each network over the frames."""
    found: dict[str, Any] = {}
    for name in NETWORKS:
        detector = models.detector(name)
        rows = []
        for frame in work:
            mesh = mesh_on_screen(detector, frame)
            times = interleaved(
                {"session": session_call(detector, mesh), "numpy": numpy_call(models.networks[name], mesh)},
                rounds if len(mesh) < 10_000 else max(rounds // 5, 5),
            )
            rows.append({"frame": frame.name, "points": len(mesh), **times})
        rows.sort(key=lambda row: row["points"])
        found[name] = {"median_frame": rows[len(rows) // 2], "frames": rows}
    return found


def median_frame(models: Models, work: list[Frame], name: str) -> Frame:
    detector = models.detector(name)
    return sorted(work, key=lambda frame: len(mesh_on_screen(detector, frame)))[len(work) // 2]


def whole_calls(models: Models, work: list[Frame], rounds: int) -> dict[str, Any]:
    """Whole calls with a warm cache, against the network alone on the same points.

    The paper measures from the picture to the network's output (section "Execution performance").
    """
    found: dict[str, Any] = {}
    for name in NETWORKS:
        frame = median_frame(models, work, name)
        detector = models.detector(name)
        seen = detector.detect(frame.image, frame.orientation, frame.lens)
        calls = {
            "whole": lambda d=detector, f=frame: d.detect(f.image, f.orientation, f.lens),
            "session": session_call(detector, mesh_on_screen(detector, frame)),
        }
        times = interleaved(calls, rounds)  # type: ignore[arg-type]
        row: dict[str, Any] = dict(times)
        row |= {"frame": frame.name, "points": len(seen.pixels)}
        row["whole_over_session"] = round(row["whole"]["p50"] / row["session"]["p50"], 2)
        row["p99_over_p50"] = round(row["whole"]["p99"] / row["whole"]["p50"], 2)
        found[name] = row
    return found


def shipped(rounds: int) -> dict[str, Any]:
    """The networks of the package, with their own reach and with 10 m, on the demo's frame with the median number of
    points."""
    found: dict[str, Any] = {}
    usual = Detector.from_file(model_path(DEFAULT))
    points = {each.name: len(usual.detect(each.image, each.orientation, each.lens).pixels) for each in demo_frames()}
    frame = sorted(demo_frames(), key=lambda each: points[each.name])[len(points) // 2]
    for name, reach in product(SHIPPED, (None, 10.0)):
        detector = Detector.from_file(model_path(name), Settings(max_distance=reach))
        detections = detector.detect(frame.image, frame.orientation, frame.lens)
        runs = measure([detector], frame.image, frame.lens, [frame.orientation] * (rounds + 5))
        stages = {stage: round(float(np.median(values[5:])), 4) for stage, values in runs[0].stages.items()}
        what = {"frame": frame.name, "found": len(detections), "points": len(detections.pixels)}
        far = detector.manifest.max_distance
        found[f"{name}, to {far:g} m"] = {**what, "total": summary(runs[0].total[5:]), "stages_ms": stages}
    return found


def peers(models: Models, work: list[Frame], rounds: int) -> dict[str, Any]:
    """Whole calls in turns on the same frame: the Visual Mesh with five and nine layers, and its peers.

    The paper's tab:visualmesh_performance. Its sections "Abstract" and "Discussion and Conclusion" compare the times.
    """
    frame = median_frame(models, work, "5x4")
    calls: dict[str, Callable[[], object]] = {}
    # Each of ours follows a peer, so that all find the processor's caches as a large network leaves them.
    for peer, name in zip_longest(PEERS, ("5x4", "9x4")):
        detector = PeerDetector(peer)
        calls[peer.name] = lambda d=detector: d.detect(frame.image)  # type: ignore[misc]
        if name:
            ours = models.detector(name)
            calls[f"Visual Mesh {name}"] = lambda d=ours: d.detect(  # type: ignore[misc]
                frame.image, frame.orientation, frame.lens
            )
    times = interleaved(calls, max(rounds // 20, 3), row=30)
    found: dict[str, Any] = {"frame": frame.name, "calls": times}
    for name in [each for each in calls if each.startswith("Visual")]:
        found[f"fastest peer over {name}"] = {
            which: round(min(times[peer.name][which] for peer in PEERS) / times[name][which], 1)
            for which in ("p50", "first")
        }
    return found


def growth(models: Models, work: list[Frame], rounds: int) -> dict[str, Any]:
    """Whole calls of a five-layer network over intersections, distance, resolution and threads.

    The paper: a higher resolution does not increase the cost (section "Discussion and Conclusion").
    """
    frame = median_frame(models, work, "5x4")

    def row(detector: Detector, frame: Frame, **what: float) -> dict[str, Any]:
        orientations = [frame.orientation] * (rounds // 2 + 5)
        run = measure([detector], frame.image, frame.lens, orientations)[0]
        return {**what, "points": int(run.points[0]), "total": summary(run.total[5:])}

    found: dict[str, Any] = {
        "intersections": [row(models.other("5x4", k, 10.0), frame, k=k) for k in (2.0, 3.0, 4.0, 5.0, 6.0, 8.0)],
        "distance": [row(models.other("5x4", 4.0, d), frame, m=d) for d in (2.5, 5.0, 10.0, 20.0, 40.0)],
        "resolution": [],
        "threads": [],
    }
    for factor in (0.25, 0.5, 1.0, 2.0, 4.0):
        image = cv2.resize(frame.image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
        size = image.shape[1], image.shape[0]
        scaled = replace(frame, image=np.asarray(image), lens=frame.lens.scaled(factor, size))
        found["resolution"].append(row(models.detector("5x4"), scaled, megapixels=round(size[0] * size[1] / 1e6, 2)))
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, _ALL_CORES)
    for name in ("5x4", "13x16"):
        other = median_frame(models, work, name)
        for threads in range(1, len(_ALL_CORES) + 1):
            what = {"network": name, "threads": threads}
            found["threads"].append(row(models.detector(name, threads=threads), other, **what))  # type: ignore[arg-type]
    os.sched_setaffinity(0, allowed)
    return found


def walks(models: Models, work: list[Frame], seconds: float) -> dict[str, Any]:
    """Walking robots: hit rate of the cache after the first swing, its memory, and the time of cold calls."""
    found: dict[str, Any] = {}
    for name in ("5x4", "13x16"):
        frame = median_frame(models, work, name)
        detector = models.detector(name)
        lens = frame.lens.for_image(frame.size)
        rows = []
        for height in (0.5, 0.8, 1.1):
            cache, largest = MeshCache(detector.manifest, detector.settings), 0.0
            middle = Orientation.from_roll_pitch(height, 0.0, 0.35)
            for number, orientation in enumerate(walk(middle, int(30 * seconds))):
                if number == 30:
                    cache.hits = cache.misses = 0
                cache.view(orientation, lens, frame.size)
                cache.prepare_nearby(orientation, lens, frame.size)
                largest = max(largest, cache.nbytes / 2**20)
            rows.append({"height_m": height, "hit_rate": round(cache.hit_rate, 4), "cache_mib": round(largest, 1)})
        orientations = [each.orientation for each in work for _ in range(4)]
        found[name] = {"walks": rows, "cold": measure_cold(detector, frame.lens, frame.size, orientations)}
    return found


def soak(models: Models, work: list[Frame], count: int) -> dict[str, Any]:
    """Resident memory over many frames with random orientations, for a five-layer network."""
    detector = models.detector("5x4", cache_mib=16.0)
    random = np.random.default_rng(0)
    frame = median_frame(models, work, "5x4")
    started, marks = perf_counter(), []
    for number in range(count):
        height = frame.orientation.height * random.uniform(0.8, 1.2)
        orientation = Orientation.from_roll_pitch(height, random.normal(0.0, 0.15), random.normal(0.5, 0.25))
        detector.detect(frame.image, orientation, frame.lens)
        if number + 1 in (count // 20, count // 10, count // 4, count // 2, 3 * count // 4, count):
            marks.append({"frames": number + 1, "rss_mib": round(rss_mib(), 1)})
    return {
        "frames": count,
        "seconds": round(perf_counter() - started),
        "hit_rate": round(detector.cache.hit_rate, 4),
        "marks": marks,
        "growth_since_a_tenth": round(marks[-1]["rss_mib"] / marks[1]["rss_mib"] - 1.0, 4),
    }


_ALL_CORES = os.sched_getaffinity(0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only", metavar="PART", help="measure only this part; the output keeps the other parts")
    parser.add_argument("--output", type=Path, default=RESULTS)
    options = parser.parse_args()
    if not options.output.parent.is_dir():
        parser.error(f"there is no folder {options.output.parent}")
    rounds, seconds, soaked = (20, 5.0, 2000) if options.quick else (400, 60.0, SOAK_FRAMES)
    os.sched_setaffinity(0, {max(_ALL_CORES)})
    cv2.setNumThreads(1)
    what, work = frames()
    print(f"on {what}", file=sys.stderr)
    with tempfile.TemporaryDirectory() as folder:
        models = Models(Path(folder))
        rate = sgemm_rate()
        found: dict[str, Any] = {"machine": describe_machine() | {"cores": len(_ALL_CORES)}, "frames": what}
        found["sgemm_gflops"] = round(rate / 1e9, 1)
        found["operations_per_point"] = {name: shape.operations for name, (shape, _, _) in NETWORKS.items()}
        parts: dict[str, Callable[[], dict[str, Any]]] = {
            "sessions": lambda: sessions(models, work, rounds // 2),
            "whole_calls": lambda: whole_calls(models, work, rounds),
            "shipped": lambda: shipped(rounds),
            "peers": lambda: peers(models, work, rounds),
            "growth": lambda: growth(models, work, rounds),
            "walks": lambda: walks(models, work, seconds),
            "soak": lambda: soak(models, work, soaked),
        }
        if options.only is not None:
            if options.only not in parts:
                parser.error(f"there is no part {options.only!r}; there are {', '.join(parts)}")
            found = json.loads(options.output.read_text())
            parts = {options.only: parts[options.only]}
        for number, (name, part) in enumerate(parts.items(), start=1):
            print(f"[{number}/{len(parts)}] {name}", file=sys.stderr, flush=True)
            found[name] = part()
    options.output.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
