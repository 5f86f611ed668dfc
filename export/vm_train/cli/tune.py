"""vm-train tune: fine-tune the close look of a model file on the user's own frames, or resume that."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.cli.program import Parser
from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.errors import InputError
from vm_embedded.network.bundled import SHIPPED, model_path
from vm_embedded.output.box_files import read_object_file

from ..boxes.findings import finding_lines
from ..tuning.configuration import TuningConfiguration
from .box_options import add_box_options, divided_remark, parse_names
from .options import SET_EXAMPLE, add_configuration, add_hardware, add_output
from .training import run_training

if TYPE_CHECKING:
    from ..runs.hardware import Hardware
    from ..tuning.run import TuningRun
    from ..tuning.training import Tuning

_FEW = 25
"""Frames for training; with fewer, the share of found boxes varied by half between seeds
(benchmarks/experiments/fine-tuning.md)."""


def tune_parser() -> argparse.ArgumentParser:
    """The options of vm-train tune FRAMES."""
    made = Parser(
        prog="vm-train tune",
        description="Fine-tune the close look of a model file on boxes of your own frames, on the CPU. They need "
        "neither lens nor pose. You can stop or kill it at any time: vm-train resume continues. The final network is "
        "the same as without the stop.",
    )
    made.add_argument(
        "boxes", type=Path, metavar="FRAMES", help="folder of frames with boxes, in YOLO, Pascal VOC or COCO format"
    )
    made.add_argument(
        "--from",
        required=True,
        dest="model",
        metavar="MODEL",
        help=f"the network: a model file (.onnx) with a close look, or one of the package ({', '.join(SHIPPED)})",
    )
    add_output(made)
    add_configuration(made, "tune")
    made.add_argument("--strict", action="store_true", help="fail if some boxes can't be used; default: skip them")
    add_box_options(made)
    made.add_argument(
        "--rendered",
        type=Path,
        metavar="RUN",
        help="folder of the vm-train look training that made the close look of MODEL; its patches are mixed in, so "
        "that the network forgets little; default: patches of the package, which show balls",
    )
    add_hardware(made)
    return made


def run_tune(options: argparse.Namespace) -> int:
    """Begin a fine-tuning, train, and return the exit status. Raises VisualMeshError."""
    from ..tuning.run import BoxSource, begin_tuning

    configuration = read_sections(TuningConfiguration, options.config, parse_overrides(options.set, SET_EXAMPLE))
    source = BoxSource(options.boxes.resolve(), options.format, parse_names(options.names))
    found, model = source.read(), model_path(options.model)
    for line in finding_lines(found.findings, False, f"vm-train check {options.boxes} --boxes --verbose lists all"):
        print(f"vm-train: {line}", file=sys.stderr)
    if options.strict and found.faults:
        raise InputError("some boxes can't be used, see above: repair them, or leave out --strict to skip them")

    def begin(hardware: Hardware) -> None:
        threads, name = options.threads or 1, str(options.model)
        run = begin_tuning(options.output, source, found, configuration, model, name, options.rendered, threads)
        _describe(run, options.boxes)

    return _train(options, options.output, None, begin)


def resume_tune(options: argparse.Namespace) -> int:
    """Resume a fine-tuning and return the exit status. Raises VisualMeshError."""
    return _train(options, options.run, options.data)


def _train(
    options: argparse.Namespace, folder: Path, moved_to: Path | None, begin: Callable[[Hardware], None] | None = None
) -> int:
    """Train in a folder. moved_to: where its boxes are now. Returns the exit status."""
    if options.device == "cuda":
        raise InputError("a fine-tuning runs on the CPU: give --device cpu, or leave it out")
    options.device = "cpu"
    return run_training(options, folder, partial(_load, folder, moved_to), _report, begin, alone=True)


def _load(folder: Path, moved_to: Path | None, hardware: Hardware) -> Tuning:
    """The fine-tuning of a folder. Raises InputError or ModelError."""
    from ..tuning.run import read_tuning
    from ..tuning.training import Tuning

    return Tuning(read_tuning(folder, moved_to), hardware)


def _describe(run: TuningRun, boxes: Path) -> None:
    """Print the numbers of frames, and what is left out."""
    from ..tuning.boxed_objects import divided

    recordings = len({each.recording for each in run.pictures})
    split = run.split
    count = len(split.training), len(split.validation), len(split.test)
    print(
        f"{boxes}: {len(run.pictures)} frames of {recordings} recording{'s' * (recordings != 1)}: {count[0]} for "
        f"training, {count[1]} for validation, {count[2]} for the test",
        flush=True,
    )
    if divided(run.pictures, map(int, split.test)):
        print(f"vm-train: {divided_remark('the test')}", file=sys.stderr)
    if count[0] < _FEW:
        print(
            f"vm-train: with fewer than {_FEW} frames for training, the result depends much on chance; about 50 of "
            "several recordings are enough",
            file=sys.stderr,
        )


def _frames_to_try(run: TuningRun) -> str:
    """What to give vm-detect: a folder of frames with lens files, if possible of the test, or what to fill in."""
    for each in run.part((*run.split.test, *run.split.validation, *run.split.training)):
        if each.lens is not None:
            return str(each.image.parent)
    return "FRAMES --lens LENS.yaml --height METERS --pitch ANGLE"


def _report(training: Tuning) -> None:
    """Print where the report is, and the commands to use next."""
    run, model = training.run, training.run.result_path
    print(f"report: {run.folder / 'report.html'}")
    if run.split.test:
        names = "".join(f" {old}={new}" for old, new in run.boxes.names.items())
        frames = f"{run.boxes.folder}{names and ' --names' + names} --list {run.split_path}"
        print(f"next: vm-evaluate --boxes {frames} {run.model} {model} -o evaluation")
    shape = read_object_file(run.boxes.folder)
    size = "" if shape is None else f" --object-radius {shape.radius:g}"
    print(f"next: vm-detect --model {model} {_frames_to_try(run)}{size} --save-overlay found")
