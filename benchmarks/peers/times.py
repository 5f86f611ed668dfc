"""Times of the paper's tab:visualmesh_performance, and per proposal: `python -m benchmarks.peers.times`.

Whole calls, from frame to boxes, on one pinned core and in turns. The random weights of the other networks do not
change their times. The networks of the package and those that teams use today also run on all reference frames and all
frames of ../shared/real, with ONNX Runtime as it is and restricted to AVX2 (see instruction_sets.py).
Writes benchmarks/peer_times.json. --quick makes fewer rounds, for a check that it works.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import cv2
import numpy as np
import torch

from vm_embedded import Detector
from vm_embedded.arrays import Image, Singles
from vm_embedded.cli.bench import describe_machine, rss_mib, sgemm_rate
from vm_embedded.detection.looking import Look
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_export.look_network import LookNetwork, LookShape
from vm_export.look_weights import look_of

from ..frames import Frame, frame_folder, frames, read_frames
from ..instruction_sets import SETS, copy_runtime
from ..networks import NETWORKS, checkpoint, model_file
from ..timing import interleaved, summary
from .networks import PEERS, Peer, PeerDetector, loaded
from .operations import operations
from .paper_networks import PROPOSALS, BoxClassifier, FasterRcnn, RegionProposals, YoloV1, YoloV2, YoloV3
from .patch_classifiers import CLASSIFIERS, PatchClassifier

RESULTS = Path(__file__).parents[1] / "peer_times.json"

RANDOM = {"Visual Mesh 5": "5x4", "Visual Mesh 9": "9x4"}
"""The paper's networks, with random weights, by their names in benchmarks/networks.py."""

PACKAGED = ("ball", "soccer")
SINGLE = (
    Peer("YOLO v1, 448", YoloV1, 448),
    Peer("YOLO v2, 416", YoloV2, 416),
    Peer("YOLO v3, 416", YoloV3, 416),
    *(peer for peer in PEERS if peer.name != "Tiny YOLO, 416"),
)
TWO_STAGE = "Faster R-CNN Inception v2, 600"

ORDER = (
    *(*RANDOM, *PACKAGED, "YOLO v1, 448", "YOLO v2, 416", "YOLO v3, 416", "SSD MobileNet v1, 300", TWO_STAGE),
    *("SSDLite MobileNet v3, 320", "YOLO nano, 320", "YOLO nano, 640"),
)
"""The paper's rows in its order, and ours; then what teams use today."""

TODAY = ("SSDLite MobileNet v3, 320", "YOLO nano, 320")
"""Detectors that teams use today, and the times of ours as shares of the last one."""

_SLOW = {"YOLO v1, 448", "YOLO v2, 416", "YOLO v3, 416", TWO_STAGE}
_ROW, _SLOW_ROW = 30, 3
"""Calls in a row in each turn."""

_BATCH = 10
"""Patches of a call: as many as the networks of the package look at for a class."""


class CountedLook:
    """A close look that counts its patches."""

    def __init__(self, look: Look) -> None:
        self.contract, self.patches, self._look = look.contract, 0, look

    def run(self, patches: Image) -> Singles:
        self.patches += len(patches)
        return self._look.run(patches)


def look_shape(name: str) -> LookShape:
    """The shape of the look of a packaged network."""
    look = look_of(read_model(model_path(name)))
    assert look is not None
    return look.network.shape


def look_operations(shape: LookShape) -> int:
    """Multiplications and additions for a patch."""
    return operations(lambda: LookNetwork(shape), (1, shape.size, shape.size, 3))


def own_call(detector: Detector, frame: Frame) -> Callable[[], object]:
    return lambda: detector.detect(frame.image, frame.orientation, frame.lens)


def own_work(name: str, detector: Detector, frame: Frame) -> dict[str, Any]:
    """Operations of a call of ours, and what they are for."""
    seen = detector.observe(frame.image, frame.orientation, frame.lens)
    points = len(seen.pixels)
    found: dict[str, Any] = {"points": points, "operations": detector.manifest.operations * points}
    if detector.look is not None:
        look, counted = detector.look, CountedLook(detector.look)
        detector.look = counted  # type: ignore[assignment]
        own_call(detector, frame)()
        detector.look = look
        found["patches"] = counted.patches
        found["operations"] += look_operations(look_shape(name)) * counted.patches
    return found


def two_stage_operations(size: tuple[int, int]) -> int:
    """Multiplications and additions of Faster R-CNN for a scaled frame of this width and height [px]."""
    cells = -(-size[1] // 16), -(-size[0] // 16)
    return operations(RegionProposals, (1, 3, size[1], size[0])) + operations(
        BoxClassifier, (1, 576, *cells), (PROPOSALS, 4)
    )


def whole_calls(frame: Frame, folder: Path, rounds: int) -> dict[str, Any]:
    """Whole calls of all detectors in turns.

    The paper's tab:visualmesh_performance.
    """
    ours: dict[str, Detector] = {}
    for name, network in RANDOM.items():
        file = model_file(checkpoint(*NETWORKS[network]), folder / f"{network}.onnx")
        ours[name] = Detector(file)
    for name in PACKAGED:
        ours[name] = Detector.from_file(name)
    work: dict[str, dict[str, Any]] = {name: own_work(name, detector, frame) for name, detector in ours.items()}
    theirs: dict[str, Callable[[], object]] = {}
    for peer in SINGLE:
        theirs[peer.name] = partial(PeerDetector(peer).detect, frame.image)
        work[peer.name] = {"operations": operations(peer.network, (1, 3, peer.side, peer.side))}
        print(f"{peer.name}: {rss_mib():.0f} MiB", file=sys.stderr)
    two_stage = FasterRcnn(frame.size)
    theirs[TWO_STAGE] = partial(two_stage.detect, frame.image)
    work[TWO_STAGE] = {"operations": two_stage_operations(two_stage.size)}
    # Each of ours follows another detector, so that all find the processor's caches as a large network leaves them.
    calls: dict[str, Callable[[], object]] = {}
    waiting = [(name, own_call(detector, frame)) for name, detector in ours.items()]
    for name, call in theirs.items():
        calls[name] = call
        if waiting:
            own_name, own = waiting.pop(0)
            calls[own_name] = own
    rows = {name: _SLOW_ROW if name in _SLOW else _ROW for name in calls}
    times = interleaved(calls, rounds, rows, warm=1)
    return {name: {**times[name], "calls": rounds * (rows[name] - 1), **work[name]} for name in ORDER}


def on_all_frames(rounds: int) -> dict[str, Any]:
    """Times of whole calls on all frames of each set, by detector [ms], and on a frame of noise.

    Each detector in turn runs over all frames, as on a robot; the first frame after another detector does not count.
    """
    found: dict[str, Any] = {}
    for name, folder in (("reference", frame_folder("reference/images")), ("real", frame_folder("real/images"))):
        if folder is None:
            continue
        work = read_frames(folder)
        detectors = {each: Detector.from_file(each) for each in PACKAGED}
        calls: dict[str, list[Callable[[], object]]] = {
            each: [own_call(detector, frame) for frame in work] for each, detector in detectors.items()
        }
        for peer in PEERS:
            if peer.name in TODAY:
                calls[peer.name] = [partial(PeerDetector(peer).detect, frame.image) for frame in work]
        times: dict[str, list[float]] = {each: [] for each in calls}
        for number in range(rounds + 1):
            for each, its_calls in calls.items():
                its_calls[-1]()
                for call in its_calls:
                    started = perf_counter()
                    call()
                    if number:  # the first round fills caches
                        times[each].append(1e3 * (perf_counter() - started))
        found[name] = {each: {**summary(np.array(values)), "calls": len(values)} for each, values in times.items()}
        for each, detector in detectors.items():
            noise = np.random.default_rng(0).integers(0, 256, work[0].image.shape, dtype=np.uint8)
            call = own_call(detector, replace(work[0], image=noise))
            found[name][each]["noise"] = interleaved({"noise": call}, 10)["noise"]["p50"]
    return found


def with_instructions(bits: int, options: Sequence[str]) -> dict[str, Any]:
    """The times on all frames in a process whose ONNX Runtime knows these instructions only."""
    with tempfile.TemporaryDirectory() as folder:
        copy_runtime(Path(folder), bits)
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([folder, *sys.path])}
        command = [sys.executable, "-m", "benchmarks.peers.times", "--all-frames", *options]
        done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True, text=True)
        found: dict[str, Any] = json.loads(done.stdout)
        return found


def classifier_call(classifier: PatchClassifier, count: int) -> Callable[[], object]:
    """A call of a classifier with this number of patches, with prepared inputs."""
    torch.manual_seed(0)
    patches = torch.rand(count, classifier.channels, classifier.side, classifier.side)
    session = loaded(classifier.network(), {"patches": patches}, ["answers"], {"patches": {0: "n"}})
    return partial(session.run, None, {"patches": patches.numpy()})


def proposals(frame: Frame, rounds: int) -> dict[str, Any]:
    """Times of classifiers for one patch, and each of a batch in one call [ms]; and the stage look of whole calls."""
    networks: dict[str, tuple[Callable[[int], Callable[[], object]], int]] = {}
    for each in CLASSIFIERS:
        count = operations(each.network, (1, each.channels, each.side, each.side))
        networks[each.name] = partial(classifier_call, each), count
    detectors = {name: Detector.from_file(name) for name in PACKAGED}
    random = np.random.default_rng(0)

    def look_call(look: Look, count: int) -> Callable[[], object]:
        size = look.contract.size
        return partial(look.run, random.integers(0, 256, (count, size, size, 3), dtype=np.uint8))

    for name, detector in detectors.items():
        shape = look_shape(name)
        title = f"close look of {name}, {shape.size} x {shape.size}"
        networks[title] = partial(look_call, detector.look), look_operations(shape)
    calls = {f"{name} / {count}": make(count) for name, (make, _) in networks.items() for count in (1, _BATCH)}
    times = interleaved(calls, rounds, row=10)
    found: dict[str, Any] = {
        name: {
            "operations": count,
            "one": times[f"{name} / 1"],
            "each of a batch": {share: round(ms / _BATCH, 4) for share, ms in times[f"{name} / {_BATCH}"].items()},
        }
        for name, (_, count) in networks.items()
    }
    stages: dict[str, list[float]] = {name: [] for name in detectors}
    for _ in range(10 * rounds):
        for name, detector in detectors.items():
            seen = detector.detect(frame.image, frame.orientation, frame.lens)
            stages[name].append(seen.timing_ms["look"])
    whole = {
        name: {**summary(np.array(stages[name])), **own_work(name, detector, frame)}
        for name, detector in detectors.items()
    }
    return {"batch": _BATCH, "networks": found, "stage": whole}


def middle_frame(work: list[Frame]) -> Frame:
    """The frame with the median number of points of the packaged network."""
    detector = Detector.from_file(PACKAGED[0])
    points = {each.name: len(detector.observe(each.image, each.orientation, each.lens).pixels) for each in work}
    return sorted(work, key=lambda each: points[each.name])[len(work) // 2]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--output", type=Path, default=RESULTS)
    parser.add_argument("--all-frames", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if not options.output.parent.is_dir():
        parser.error(f"there is no folder {options.output.parent}")
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    rounds = 2 if options.quick else 20
    if options.all_frames:
        print(json.dumps(on_all_frames(rounds)))
        return
    what, work = frames()
    frame = middle_frame(work)
    found: dict[str, Any] = {
        "machine": describe_machine() | {"cores": len(cores)},
        "sgemm_gflops": round(sgemm_rate() / 1e9, 1),
        "command": " ".join(["python -m benchmarks.peers.times", *(["--quick"] if options.quick else [])]),
        "frames": what,
        "frame": {"name": frame.name, "size": frame.size},
    }
    with tempfile.TemporaryDirectory() as folder:
        found["proposals"] = proposals(frame, 5 if options.quick else 40)
        found["calls"] = whole_calls(frame, Path(folder), 2 if options.quick else 10)
    quick = ["--quick"] if options.quick else []
    found["all frames"] = {name: with_instructions(SETS[name], quick) for name in ("AVX2", "this processor")}
    options.output.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
