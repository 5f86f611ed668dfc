"""The networks on processors with fewer vector instructions: `python -m benchmarks.instruction_sets`.

ONNX Runtime asks the processor which vector registers the operating system saves, and chooses its kernels by the
answer. In copies of ONNX Runtime, this program clears bits of the answer, so they run on any x86 processor as on an
older one. numpy and OpenCV keep all instructions. Compared programs take turns on one pinned core. Adds a part to
benchmarks/results.json.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any

import cv2
import numpy as np
import onnxruntime

from vm_embedded import Detector
from vm_embedded.errors import InputError
from vm_embedded.network.bundled import model_path

from .frames import frames
from .run import RESULTS, Models, mesh_on_screen, session_call
from .timing import summary

SETS = {"this processor": 0xFF, "AVX2": 0x1F, "SSE": 0x01}
"""Names of instruction sets, and the bits of the answer that a processor with these instructions has."""

NETWORKS = ("5x4", "9x4", "13x16")
PACKAGED = ("ball", "soccer")

_ASKED = bytes.fromhex("0f01d089c0")
_CLEARED = bytes.fromhex("0f01d024")
"""Machine code of `xgetbv; mov eax, eax`, and of `xgetbv; and al, BITS` without its last byte. In 64-bit mode, the
first pair's second instruction only repeats what xgetbv has done."""


def copy_runtime(folder: Path, bits: int) -> None:
    """Copy ONNX Runtime into a folder, with only these bits of the answer.

    Raises InputError for a build that asks the processor in another way, as those for ARM do.
    """
    shutil.copytree(Path(onnxruntime.__file__).parent, folder / "onnxruntime")
    changed = 0
    for library in (folder / "onnxruntime" / "capi").glob("onnxruntime_pybind11_state*.so"):
        content = library.read_bytes()
        changed += content.count(_ASKED)
        library.write_bytes(content.replace(_ASKED, _CLEARED + bytes([bits])))
    if not changed:
        raise InputError(f"this build of ONNX Runtime ({onnxruntime.__version__}) asks the processor in another way")


@contextmanager
def worker(folder: Path) -> Iterator[Callable[[], dict[str, Any]]]:
    """A process that measures with the copy of ONNX Runtime in a folder: a call gives the times of one turn."""
    command = [sys.executable, "-m", "benchmarks.instruction_sets", "--worker", str(folder)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), *sys.path])}
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    ) as process:

        def turn() -> dict[str, Any]:
            assert process.stdin is not None
            assert process.stdout is not None
            print("turn", file=process.stdin, flush=True)
            found: dict[str, Any] = json.loads(process.stdout.readline())
            return found

        try:
            yield turn
        finally:
            process.terminate()


def work(folder: Path) -> None:
    """Measure in turns, one for each line of standard input: [ms] of five calls, by network and kind of call."""
    assert Path(onnxruntime.__file__).is_relative_to(folder), onnxruntime.__file__
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    cv2.setNumThreads(1)
    _, pictures = frames()
    with tempfile.TemporaryDirectory() as made:
        models = Models(Path(made))
        detectors = {name: models.detector(name) for name in NETWORKS}
        detectors |= {name: Detector.from_file(model_path(name)) for name in PACKAGED}
        calls: dict[tuple[str, str], Callable[[], object]] = {}
        for name, detector in detectors.items():
            by_points = sorted(pictures, key=lambda frame: len(mesh_on_screen(detector, frame)))
            frame = by_points[len(by_points) // 2]
            calls[name, "session"] = session_call(detector, mesh_on_screen(detector, frame))
            calls[name, "whole"] = lambda d=detector, f=frame: d.detect(f.image, f.orientation, f.lens)  # type: ignore[misc]
        for _ in sys.stdin:
            print(json.dumps([[*key, _five(call)] for key, call in calls.items()]), flush=True)


def _five(call: Callable[[], object]) -> list[float]:
    """Times of five calls in a row, after one that is not measured [ms]."""
    call()
    times = []
    for _ in range(5):
        started = perf_counter()
        call()
        times.append(1e3 * (perf_counter() - started))
    return times


def compare(rounds: int) -> dict[str, Any]:
    """Times of sessions and whole calls, by instruction set and network."""
    times: dict[tuple[str, str, str], list[float]] = {}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        workers = {}
        for name, bits in SETS.items():
            copy_runtime(folder / name, bits)
            workers[name] = stack.enter_context(worker(folder / name))
        for number in range(rounds + 1):
            for name, turn in workers.items():
                for network, kind, values in turn():
                    if number:  # the first round fills caches
                        times.setdefault((name, network, kind), []).extend(values)
    found: dict[str, Any] = {}
    for (name, network, kind), values in times.items():
        found.setdefault(name, {}).setdefault(network, {})[kind] = summary(np.array(values))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=40, help="turns of each instruction set")
    parser.add_argument("--worker", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker is not None:
        work(options.worker)
        return
    found = json.loads(RESULTS.read_text())
    try:
        found["instruction_sets"] = compare(options.rounds)
    except InputError as error:
        print(f"not measured: {error}", file=sys.stderr)
        return
    RESULTS.write_text(json.dumps(found, indent=1) + "\n")
    print(json.dumps(found["instruction_sets"], indent=1))


if __name__ == "__main__":
    main()
