"""vm-bench: how fast the detector is on this machine, with the user's model, lens and orientations."""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2

from ..arrays import Image
from ..cameras.image_files import check_file_format, read_image
from ..config.units import parse_angle, parse_length
from ..detection.detector import Detector
from ..detection.sampling import checked_image
from ..errors import InputError, VisualMeshError
from ..files import atomic_write, check_writable
from ..geometry.lens import Lens, Size
from ..geometry.orientation import Orientation
from ..geometry.radial_lenses import Rectilinear
from ..live.configuration import Configuration
from ..network.bundled import model_path
from ..network.model_file import ModelFile, read_model
from .measuring import STAGES, Run, cold, drawn_image, machine, measure, rss_mib, sgemm_rate, walk
from .options import ANGLES, add_model, add_pose, add_settings, read_options
from .progress import ProgressBar
from .tuning import check_editable, tuned, write_settings

EXIT_OK, EXIT_FAILED, EXIT_INTERRUPTED = 0, 1, 130

_SIZE, _HEIGHT, _PITCH = (1280, 1024), 0.6, 0.4
"""Of a camera of which nothing was said [px], [m], [rad]."""


_TUNED_FRAMES = 300
"""Ten seconds: with fewer frames most calls are cold."""


def parser() -> argparse.ArgumentParser:
    """The command line of vm-bench."""
    parser = argparse.ArgumentParser(
        prog="vm-bench",
        description="Measure the detector on this machine while a robot walks: the whole call and its stages, for one "
        "thread and more, warm and cold, and how far the network is from the least time that its operations can take.",
        epilog="Exit status: 0 measured, 1 not (the reason is on standard error), 2 wrong usage, 130 interrupted. "
        + ANGLES,
    )
    add_model(parser)
    add_pose(parser, "what the robot walks around; a reference lens file brings its orientation")
    work = parser.add_argument_group("work")
    work.add_argument("--image", type=Path, metavar="FILE", help="frame to look at; default: a drawn, empty field")
    work.add_argument(
        "--size", metavar="WxH", help="size of the drawn field [px]; default: the lens file's, or 1280x1024"
    )
    work.add_argument("--frames", type=int, default=900, metavar="N", help="length of the walk at 30 Hz; default 900")
    work.add_argument(
        "--swing", default="10deg", metavar="ANGLE", help="of pitch and roll, to both sides; default 10deg"
    )
    work.add_argument("--sway", default="0.03", metavar="M", help="of the height, up and down [m]; default 0.03")
    work.add_argument("--up-to", type=int, metavar="N", help="most threads to try; default: all, or just --threads")
    output = parser.add_argument_group("output")
    output.add_argument(
        "--json", type=Path, metavar="FILE", help="also write all figures as JSON; - for standard output"
    )
    output.add_argument(
        "--tune", type=Path, metavar="FILE", help="read this vm.toml, and write the best settings into it"
    )
    add_settings(parser)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-bench and return its exit status."""
    options = parser().parse_args(arguments)
    cv2.setNumThreads(1)  # as vm-detect does
    try:
        return _run(options)
    except VisualMeshError as error:
        print(f"vm-bench: {' '.join(str(error).split())}", file=sys.stderr)
        return EXIT_FAILED
    except OSError as error:
        print(f"vm-bench: can't write results: {error.strerror or error}", file=sys.stderr)
        return EXIT_FAILED
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED


def _run(options: argparse.Namespace) -> int:
    if options.tune is not None and options.config is None and options.tune.is_file():
        options.config = options.tune
    given = read_options(options)
    work = _work(options, given)
    json_to_stdout = str(options.json) == "-"
    if options.json is not None and not json_to_stdout:
        check_writable(options.json)
    if options.tune is not None:
        _check_tuning(options, given)
    model = read_model(model_path(given.model))
    if options.threads is None:
        most = min(options.up_to or work.cores, work.cores)
        settings = [replace(given.detector, threads=count) for count in range(1, most + 1)]
    else:
        settings = [given.detector]
    detectors = [Detector(model, each) for each in settings]
    progress = ProgressBar(options.frames)
    runs = measure(detectors, work.image, work.lens, work.orientations, progress.show)
    progress.clear()
    found = _figures(options, model, detectors, runs, work)
    if not json_to_stdout:
        print(table(found), flush=True)
    if options.tune is not None:
        progress = ProgressBar(options.frames)
        highest = max(each.threads for each in settings)
        found["tuned"] = tuned(model, given.detector, highest, work.image, work.lens, work.orientations, progress.show)
        progress.clear()
    text = json.dumps(found, indent=1, allow_nan=False)
    if json_to_stdout:
        print(text)
    elif options.json is not None:
        with atomic_write(options.json) as part:
            part.write_text(text + "\n", encoding="utf-8")
    if options.tune is not None:
        write_settings(options.tune, found["tuned"])
        chosen = ", ".join(f"{name} = {value}" for name, value in found["tuned"].items())
        print(f"{options.tune}: {chosen}", file=sys.stderr if json_to_stdout else sys.stdout)
    return EXIT_OK


@dataclass(frozen=True)
class _Work:
    """What is measured on."""

    image: Image
    lens: Lens
    middle: Orientation
    swing: float
    sway: float
    orientations: list[Orientation]
    cores: int

    @property
    def size(self) -> Size:
        return self.image.shape[1], self.image.shape[0]


def _work(options: argparse.Namespace, given: Configuration) -> _Work:
    """The frame, the lens and the walk. Raises InputError."""
    swing, sway = parse_angle(options.swing), parse_length(options.sway)
    if options.frames < 1 or (options.up_to is not None and options.up_to < 1):
        raise InputError(f"--frames and --up-to must be at least 1, not {options.frames} and {options.up_to}")
    middle = (
        given.orientation.orientation()
        or (given.lens.orientation if given.lens else None)
        or Orientation.from_roll_pitch(_HEIGHT, 0.0, _PITCH)
    )
    if abs(sway) >= middle.height:
        raise InputError(f"--sway {sway:g} m takes a camera at {middle.height:g} m below the plane")
    image, lens = _frame_and_lens(options, given.lens.lens if given.lens else None, given.detector.format)
    orientations = walk(middle, swing, sway, options.frames)
    return _Work(image, lens, middle, swing, sway, orientations, len(os.sched_getaffinity(0)))


def _frame_and_lens(options: argparse.Namespace, lens: Lens | None, format: str) -> tuple[Image, Lens]:
    """The frame to look at, and the lens it was taken with."""
    if options.image is None:
        size = _size(options.size) if options.size else (lens.size if lens and lens.size else _SIZE)
        return drawn_image(size, format), lens or Rectilinear(focal_length=0.5 * size[0], fov=2.0)
    if options.size is not None:
        raise InputError("--size is of the drawn field; an --image has its own")
    check_file_format(format)
    image = checked_image(read_image(options.image, raw=format != "bgr"), format)
    return image, lens or Rectilinear(focal_length=0.5 * image.shape[1], fov=2.0)


def _size(text: str) -> Size:
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isascii() and part.isdecimal() and 2 <= int(part) <= 20000 for part in parts):
        raise InputError(f"{text!r} is not a size; write width and height in pixels as in 1280x1024")
    return int(parts[0]), int(parts[1])


def _check_tuning(options: argparse.Namespace, given: Configuration) -> None:
    """Raise InputError if tuning would be in vain."""
    check_editable(options.tune)
    if given.detector.height_tolerance == 0.0:
        raise InputError("--tune has nothing to tune with --height-tolerance 0, which prepares nothing")
    if options.frames < _TUNED_FRAMES:
        raise InputError(f"--tune needs a walk of at least {_TUNED_FRAMES} frames, not {options.frames}")


def _figures(
    options: argparse.Namespace, model: ModelFile, detectors: Sequence[Detector], runs: Sequence[Run], work: _Work
) -> dict[str, Any]:
    rate = sgemm_rate()
    operations = model.manifest.operations
    floor_ns = 1e9 * operations / rate if operations else None
    return {
        "machine": machine(),
        "model": {"file": model.path.name, "sha256": model.sha256, "layout": model.manifest.layout},
        "image": list(work.size),
        "walk": {
            "frames": options.frames,
            "height_m": work.middle.height,
            "pitch_rad": work.middle.pitch,
            "roll_rad": work.middle.roll,
            "swing_rad": work.swing,
            "sway_m": work.sway,
        },
        "operations_per_point": operations,
        "sgemm_gflops": round(rate / 1e9, 1),
        "runs": [run.as_dict(floor_ns) for run in runs],
        "cold": cold(detectors[0], work.lens, work.size, work.orientations[:: max(options.frames // 20, 1)]),
        "rss_mib": round(rss_mib(), 1),
    }


def table(found: dict[str, Any]) -> str:
    """The figures as text, milliseconds unless said otherwise."""
    machine, cold = found["machine"], found["cold"]
    walked = found["walk"]
    lines = [
        f"{machine['processor']}, {machine['cores']} cores, {machine['vectors']}, onnxruntime {machine['onnxruntime']}",
        f"{found['model']['file']}: layout {found['model']['layout']}, {found['operations_per_point']} operations "
        f"a point; sgemm {found['sgemm_gflops']:g} GFLOP/s on one core",
        f"{walked['frames']} frames of {found['image'][0]}x{found['image'][1]}, "
        f"median {found['runs'][0]['points']} points, around height {walked['height_m']:.2f} m, "
        f"pitch {math.degrees(walked['pitch_rad']):.0f} deg, roll {math.degrees(walked['roll_rad']):.0f} deg",
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
    lines += ["", f"{'stage':>8}" + "".join(f"{stage:>9}" for stage in STAGES)]
    for run in found["runs"]:
        stages = run["stages_ms"]
        lines.append(f"{run['threads']:>8}" + "".join(f"{stages[stage]['p50']:>9.3f}" for stage in STAGES))
        lines.append(f"{'share':>8}" + "".join(f"{100 * stages[stage]['share']:>8.1f}%" for stage in STAGES))
    lines += [
        "",
        f"cold bucket {cold['bucket_ms']['p50']:.1f} (p99 {cold['bucket_ms']['p99']:.1f}), with a new mesh "
        f"{cold['mesh_and_bucket_ms']['p50']:.1f} (p99 {cold['mesh_and_bucket_ms']['p99']:.1f}); "
        f"memory of the process {found['rss_mib']:.0f} MiB",
        "milliseconds, stages as medians, shares of all the time; x floor: the network's time over what its operations "
        "take at the sgemm rate of one core",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
