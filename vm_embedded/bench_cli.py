"""vm-bench: how fast the detector is on this machine, with the user's model, lens and orientations."""

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

from .bench import STAGES, cold, drawn_image, machine, measure, rss_mib, sgemm_rate, walk
from .configuration import angle, length
from .detector import Detector
from .errors import InputError, VisualMeshError
from .files import written_beside
from .lens import Lens, Rectilinear, Size
from .onnx_file import read_model
from .options import ANGLES, add_model, add_pose, add_settings, read_options
from .orientation import Orientation
from .progress import Progress
from .sampling import checked_image
from .sources import read_image
from .tuning import tuned, write_settings

EXIT_OK, EXIT_FAILED, EXIT_INTERRUPTED = 0, 1, 130

_SIZE, _HEIGHT, _PITCH = (1280, 1024), 0.6, 0.4
"""Of a camera of which nothing was said [px], [m], [rad]."""


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
    work.add_argument("--up-to", type=int, metavar="N", help="most threads to try; default: all that may be used")
    output = parser.add_argument_group("output")
    output.add_argument(
        "--json", type=Path, metavar="FILE", help="also write all figures as JSON; - for standard output"
    )
    output.add_argument("--tune", type=Path, metavar="FILE", help="write the best settings into this vm.toml")
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
    given = read_options(options)
    swing, sway = angle(options.swing), length(options.sway)
    most = len(os.sched_getaffinity(0)) if options.up_to is None else options.up_to
    if options.frames < 1 or most < 1:
        raise InputError(f"--frames and --up-to must be at least 1, not {options.frames} and {most}")
    model = read_model(given.model)
    image, lens = _frame_and_lens(options, given.lens, given.settings.format)
    size = image.shape[1], image.shape[0]
    middle = given.orientation or Orientation.from_roll_pitch(_HEIGHT, 0.0, _PITCH)
    orientations = walk(middle, swing, sway, options.frames)
    counts = range(1, min(most, len(os.sched_getaffinity(0))) + 1)
    detectors = [Detector(model, replace(given.settings, threads=count)) for count in counts]
    progress = Progress(options.frames)
    runs = measure(detectors, image, lens, orientations, progress.show)
    progress.clear()
    rate = sgemm_rate()
    operations = model.manifest.operations
    floor_ns = 1e9 * operations / rate if operations else None
    found: dict[str, Any] = {
        "machine": machine(),
        "model": {"file": given.model.name, "sha256": model.sha256, "layout": model.manifest.layout},
        "image": list(size),
        "walk": {"frames": options.frames, "swing_rad": swing, "sway_m": sway, "height_m": middle.height},
        "operations_per_point": operations,
        "sgemm_gflops": round(rate / 1e9, 1),
        "runs": [run.as_dict(floor_ns) for run in runs],
        "cold": cold(detectors[0], lens, size, orientations[:: max(len(orientations) // 20, 1)]),
        "rss_mib": round(rss_mib(), 1),
    }
    if options.tune is not None:
        found["tuned"] = tuned(model, given.settings, most, image, lens, orientations)
        write_settings(options.tune, found["tuned"])
    to_stdout = options.json is not None and str(options.json) == "-"
    if to_stdout:
        print(json.dumps(found, indent=1, allow_nan=False))
        return EXIT_OK
    print(table(found))
    if options.json is not None:
        with written_beside(options.json) as part:
            part.write_text(json.dumps(found, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    if options.tune is not None:
        print(f"\n{options.tune}: " + ", ".join(f"{name} = {value}" for name, value in found["tuned"].items()))
    return EXIT_OK


def _frame_and_lens(options: argparse.Namespace, lens: Lens | None, format: str) -> tuple[Any, Lens]:
    """The frame to look at, and the lens it was taken with."""
    size = _size(options.size) if options.size else (lens.size if lens and lens.size else _SIZE)
    lens = lens or Rectilinear(focal_length=0.5 * size[0], fov=2.0)
    if options.image is None:
        return drawn_image(size, format), lens
    image = read_image(options.image, raw=format != "bgr")
    return checked_image(image, format), lens


def _size(text: str) -> Size:
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdigit() and 2 <= int(part) <= 20000 for part in parts):
        raise InputError(f"{text!r} is not a size; write width and height in pixels as in 1280x1024")
    return int(parts[0]), int(parts[1])


def table(found: dict[str, Any]) -> str:
    """The figures as text, milliseconds unless said otherwise."""
    machine, cold = found["machine"], found["cold"]
    lines = [
        f"{machine['processor']}, {machine['cores']} cores, {machine['vectors']}, onnxruntime {machine['onnxruntime']}",
        f"{found['model']['file']}: layout {found['model']['layout']}, {found['operations_per_point']} operations "
        f"a point; sgemm {found['sgemm_gflops']:g} GFLOP/s on one core",
        f"{found['walk']['frames']} frames of {found['image'][0]}x{found['image'][1]}, "
        f"median {found['runs'][0]['points']} points",
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
        lines.append(f"{'':>8}" + "".join(f"{100 * stages[stage]['share']:>8.1f}%" for stage in STAGES))
    lines += [
        "",
        f"cold bucket {cold['bucket_ms']['p50']:.1f} (p99 {cold['bucket_ms']['p99']:.1f}), with a new mesh "
        f"{cold['mesh_and_bucket_ms']['p50']:.1f} (p99 {cold['mesh_and_bucket_ms']['p99']:.1f}); "
        f"memory of the process {found['rss_mib']:.0f} MiB",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
