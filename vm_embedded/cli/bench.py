"""vm-bench: measure the speed of the detector on this machine, with the user's model, lens and orientation."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2

from ..detection.detector import Detector
from ..detection.settings import Settings
from ..errors import InputError
from ..files import check_writable, write_file
from ..live.configuration import Configuration
from ..network.bundled import model_path
from ..network.model_file import ModelFile, read_model
from .bench_table import bench_table
from .machine import describe_machine, rss_mib, sgemm_rate
from .measuring import Run, measure, measure_cold
from .options import ANGLES, add_model, add_pose, add_settings, read_options
from .program import EXIT_OK, Parser, complain, program, run_or_complain
from .progress import ProgressBar
from .tuning import fastest_settings
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
        "model": {"file": model.path.name, "sha256": model.sha256},
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


if __name__ == "__main__":
    sys.exit(main())
