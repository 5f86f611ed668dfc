"""vm-bench: measure the speed of the detector on this machine, with the user's model, lens and orientation."""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..detection.detector import Detector
from ..detection.settings import Settings
from ..errors import InputError
from ..files import check_writable, write_file
from ..live.configuration import Configuration
from ..live.system import resident_bytes
from ..network.bundled import model_path
from ..network.model_file import ModelFile, read_model
from ..network.onnx_model import RUNTIME_VERSION
from .measuring import Run, measure, measure_cold
from .options import ANGLES, add_model, add_pose, add_settings, read_options
from .processor import read_processor
from .program import EXIT_OK, Parser, complain, program, run_or_complain
from .progress import ProgressBar
from .workload import SWAY, SWING, Workload, make_workload

_TUNING_FRAMES = 300
"""Ten seconds: in a shorter walk most calls are cold."""


def parser() -> argparse.ArgumentParser:
    """The command line of vm-bench."""
    parser = Parser(
        prog="vm-bench",
        description="Measure the detector on this machine, with the poses of a simulated robot that walks: the whole "
        "call and its stages, with one thread and with more, and the extra time of a frame whose orientation or height "
        "is not in the cache of meshes. Compare the network's time with the theoretical minimum for its operations.",
        epilog="Exit status: 0 success, 1 failure (the reason is on standard error), 2 wrong usage, 130 interrupted. "
        + ANGLES,
    )
    add_model(parser)
    add_pose(parser, "the mean pose of the walking robot; a lens file of the reference can contain it")
    work = parser.add_argument_group("work")
    work.add_argument("--image", type=Path, metavar="FILE", help="image to detect in; default: a drawn, empty field")
    work.add_argument(
        "--size", metavar="WxH", help="size of the drawn field [px]; default: that of the lens file, or 1280x1024"
    )
    work.add_argument("--frames", type=int, default=900, metavar="N", help="frames to measure, at 30 Hz; default 900")
    work.add_argument(
        "--up-to",
        type=int,
        metavar="N",
        help="largest number of threads to try, unless --threads is given; default: all cores",
    )
    output = parser.add_argument_group("output")
    output.add_argument(
        "--json", type=Path, metavar="FILE", help="also write all figures as JSON; - prints them instead of the table"
    )
    output.add_argument("--tune", action="store_true", help="also print the fastest settings, for vm.toml")
    add_settings(parser)
    return parser


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-bench and return its exit status."""
    options = parser().parse_args(arguments)
    cv2.setNumThreads(1)  # as vm-detect does
    return run_or_complain("vm-bench", lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    """Check all options, measure, print the figures, and tune if asked to."""
    given = read_options(options)
    if options.up_to is not None and options.up_to < 1:
        raise InputError(f"--up-to must be at least 1, not {options.up_to}")
    work = make_workload(options, given)
    network = model_path(given.model)
    _check_options(options, given, network)
    model = read_model(network)
    settings = _settings_to_measure(options, given.detector)
    detectors = [Detector(model, each) for each in settings]
    bar = ProgressBar(options.frames, unit="calls")
    runs = measure(detectors, work.image, work.lens, work.orientations, bar.show)
    bar.clear()
    _complain_about_defaults(given, work)
    found = _figures(model, work, detectors, runs)
    if not _prints_json(options):
        print(bench_table(found), flush=True)
    if options.tune:
        bar = ProgressBar(options.frames, unit="calls")
        threads = max(each.threads for each in settings)
        found["tuned"] = fastest_settings(model, given.detector, threads, work, bar.show)
        bar.clear()
        if not _prints_json(options):
            entries = (f"{name} = {json.dumps(value)}" for name, value in found["tuned"].items())
            print("\n[detector]", *entries, sep="\n")
    text = json.dumps(found, indent=1, allow_nan=False)
    if _prints_json(options):
        print(text)
    elif options.json is not None:
        write_file(options.json, text + "\n")
    return EXIT_OK


def _prints_json(options: argparse.Namespace) -> bool:
    return str(options.json) == "-"


def _check_options(options: argparse.Namespace, given: Configuration, network: Path) -> None:
    """Raise InputError if a file can't be written or tuning can't work, before anything is measured.

    network: the model file.
    """
    if options.json is not None and not _prints_json(options):
        check_writable(options.json, (options.image, options.lens, network, options.config))
    if not options.tune:
        return
    if given.detector.height_tolerance == 0.0:
        raise InputError("--tune needs prepared meshes; give a --height-tolerance above 0")
    if options.frames < _TUNING_FRAMES:
        raise InputError(f"--tune needs --frames of at least {_TUNING_FRAMES}, not {options.frames}")


def _settings_to_measure(options: argparse.Namespace, given: Settings) -> list[Settings]:
    """The given settings if they name the number of threads; else with each number from one to all cores."""
    if options.threads is not None:
        return [given]
    cores = len(os.sched_getaffinity(0))
    return [replace(given, threads=count + 1) for count in range(min(options.up_to or cores, cores))]


def _complain_about_defaults(given: Configuration, work: Workload) -> None:
    """Say that lens or pose are not the user's, because they decide how long a frame takes."""
    has_lens, has_pose = given.lens_for(work.size) is not None, given.fixed_orientation() is not None
    assumed = [name for name, is_given in (("lens", has_lens), ("pose", has_pose)) if not is_given]
    if assumed:
        complain(
            "vm-bench",
            f"no {' and no '.join(assumed)} given, so common ones were used; the robot's own decide how many points a "
            "frame has",
        )


def _figures(model: ModelFile, work: Workload, detectors: Sequence[Detector], runs: Sequence[Run]) -> dict[str, Any]:
    """All figures as plain values for JSON; the names end with their units."""
    rate = sgemm_rate()
    operations = model.manifest.operations
    floor_ns = 1e9 * operations / rate if operations else None
    frames = len(work.orientations)
    return {
        "machine": describe_machine(),
        "model": {"file": model.path.name, "sha256": model.sha256, "layout": model.manifest.layout},
        "image": list(work.size),
        "walk": {
            "frames": frames,
            "height_m": work.middle.height,
            "pitch_rad": work.middle.pitch,
            "roll_rad": work.middle.roll,
            "swing_rad": SWING,
            "sway_m": SWAY,
        },
        "operations_per_point": operations,
        "sgemm_gflops": round(rate / 1e9, 1),
        "runs": [run.as_dict(floor_ns) for run in runs],
        "cold": measure_cold(detectors[0], work.lens, work.size, work.orientations[:: max(frames // 20, 1)]),
        "rss_mib": round(rss_mib(), 1),
    }


def bench_table(found: dict[str, Any]) -> str:
    """The figures that vm-bench writes as JSON, as lines of text; times are milliseconds."""
    machine, cold, walk = found["machine"], found["cold"], found["walk"]
    lines = [
        f"{machine['processor']}, {machine['cores']} cores, {machine['vectors']}, onnxruntime {machine['onnxruntime']}",
        f"{found['model']['file']}: layout {found['model']['layout']}, {found['operations_per_point']} operations "
        f"per point; sgemm {found['sgemm_gflops']:g} GFLOP/s on one core",
        f"{walk['frames']} frames of {found['image'][0]}x{found['image'][1]}, "
        f"median {found['runs'][0]['points']} points, around height {walk['height_m']:.2f} m, "
        f"pitch {round(math.degrees(walk['pitch_rad']))} deg, roll {round(math.degrees(walk['roll_rad']))} deg",
        "",
        f"{'threads':>8}{'p50':>9}{'p90':>9}{'p99':>9}{'p99.9':>9}"
        f"{'points/s':>12}{'x floor':>9}{'hits':>8}{'cache MiB':>11}",
    ]
    for run in found["runs"]:
        total = run["total_ms"]
        over = "-" if run["infer_over_floor"] is None else f"{run['infer_over_floor']:.1f}"
        lines.append(
            f"{run['threads']:>8}{total['p50']:>9.3f}{total['p90']:>9.3f}{total['p99']:>9.3f}{total['p99.9']:>9.3f}"
            f"{run['points_per_s']:>12,}{over:>9}{100 * run['hit_rate']:>7.1f}%{run['cache_mib']:>11.1f}"
        )
    names = list(found["runs"][0]["stages_ms"])
    lines += ["", f"{'stage':>8}" + "".join(f"{name:>9}" for name in names)]
    for run in found["runs"]:
        stages = run["stages_ms"].values()
        lines.append(f"{run['threads']:>8}" + "".join(f"{each['p50']:>9.3f}" for each in stages))
        lines.append(f"{'share':>8}" + "".join(f"{100 * each['share']:>8.1f}%" for each in stages))
    bucket, mesh = cold["bucket_ms"], cold["mesh_and_bucket_ms"]
    lines += [
        "",
        f"first frame of a new orientation bucket: {bucket['p50']:.1f} more (p99 {bucket['p99']:.1f}), "
        f"of a new mesh height: {mesh['p50']:.1f} more (p99 {mesh['p99']:.1f})",
        f"memory of the process: {found['rss_mib']:.0f} MiB",
        "times in milliseconds; stages: median and share of the total time; x floor: time of the network divided by "
        "the time of its operations at the sgemm rate; first frame: median time to prepare mesh and points that the "
        "cache does not have",
    ]
    return "\n".join(lines)


TUNED = ("threads", "spinning", "pitch_step", "roll_step")
"""The settings that are tuned."""

_STEPS = (0.02, 0.03, 0.05, 0.08)
"""Bucket steps to try [rad]: small ones look at fewer points, large ones are prepared less often."""

_WORTH_A_CORE = 0.8
"""More threads, or spinning ones, must bring a call's time down to this share: the robot needs its cores."""


def fastest_settings(
    model: ModelFile,
    settings: Settings,
    threads: int,
    work: Workload,
    progress: Callable[[int], None],
) -> dict[str, Any]:
    """The fastest values of TUNED on a walk, the other settings as given.

    It compares numbers of threads up to `threads`; then threads that spin or not; then bucket steps. Spinning is
    measured in separate walks, because spinning threads slow down the calls that follow. Bucket steps are compared by
    the mean over all calls, which includes cold ones. progress: see `measure`.
    """

    def runs(candidates: Sequence[Settings]) -> list[Run]:
        return measure(
            [Detector(model, each) for each in candidates], work.image, work.lens, work.orientations, progress
        )

    def medians(candidates: Sequence[Settings]) -> list[float]:
        return [float(np.median(run.total)) for run in runs(candidates)]

    candidates = [replace(settings, threads=count, spinning=False) for count in range(1, threads + 1)]
    best, fastest = candidates[0], np.inf
    for each, time in zip(candidates, medians(candidates), strict=True):
        if time < _WORTH_A_CORE * fastest:
            best, fastest = each, time
    if best.threads > 1:
        spinning = replace(best, spinning=True)
        if medians([spinning])[0] < _WORTH_A_CORE * medians([best])[0]:
            best = spinning
    candidates = [replace(best, pitch_step=step, roll_step=step) for step in _STEPS]
    best = candidates[int(np.argmin([run.total.mean() for run in runs(candidates)]))]
    return {name: getattr(best, name) for name in TUNED}


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


def describe_machine(cpuinfo: Path = Path("/proc/cpuinfo")) -> dict[str, Any]:
    """Processor, number of usable cores, vector instructions, and versions of Python and the libraries."""
    name, flags, _ = read_processor(cpuinfo)
    return {
        "processor": name,
        "cores": len(os.sched_getaffinity(0)),
        "vectors": next((each for each in ("avx512f", "avx2", "avx", "sse4_2", "asimd") if each in flags), "unknown"),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "opencv": cv2.__version__,
        "onnxruntime": RUNTIME_VERSION,
    }


def sgemm_rate() -> float:
    """Multiplications and additions per second [1/s] of numpy's single-precision matrix product on one core.

    It runs in a separate process, because numpy fixes its number of threads when it is loaded.
    """
    one = dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BLIS_NUM_THREADS"), "1")
    done = subprocess.run(
        [sys.executable, "-c", _SGEMM], env={**os.environ, **one}, capture_output=True, text=True, check=True
    )
    return float(done.stdout)


def rss_mib() -> float:
    """Resident memory of this process [MiB]."""
    return resident_bytes() / 2**20


if __name__ == "__main__":
    sys.exit(main())
