"""vm-train look --boxes: fine-tune the close look of a model file on the user's own frames, or resume that."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.cli.program import EXIT_OK, Parser
from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError
from vm_embedded.network.bundled import model_path

from ..boxes.findings import finding_lines
from ..learning.folder_access import locked
from ..tuning.configuration import TUNING_HEADER, TuningConfiguration
from .box_options import divided_remark, parse_names
from .training import stop_requests

if TYPE_CHECKING:
    from ..tuning.run_folder import TuningRun

_FEW = 25
"""Frames for training; with fewer, the share of found boxes varied by half between seeds
(benchmarks/experiments/fine-tuning.md)."""


def tune_config_parser() -> argparse.ArgumentParser:
    """The parser of vm-train tune-config, which has no options."""
    return Parser(
        prog="vm-train tune-config",
        description="Print a tune.toml, the configuration of vm-train look --boxes, with all entries, their meanings, "
        "units, limits and defaults.",
    )


def print_tune_config(options: argparse.Namespace) -> int:
    """Print a tune.toml with all defaults."""
    print(to_commented_toml(TuningConfiguration(), TUNING_HEADER), end="")
    return EXIT_OK


def resume_fine_tuning(options: argparse.Namespace) -> int:
    """Resume a fine-tuning and return the exit status. Raises VisualMeshError."""
    from ..tuning.run_folder import read_tuning

    _check_device(options.device)
    with locked(options.run):
        return _fine_tune(read_tuning(options.run, options.data), options)


def begin_fine_tuning(options: argparse.Namespace) -> int:
    """Write the folder of a fine-tuning, train, and return the exit status. Raises VisualMeshError."""
    from ..tuning.run_folder import BoxSource, begin_tuning

    _check_device(options.device)
    others = {"DATA": options.data, "--start": options.start}
    given = [name for name, value in others.items() if value is not None]
    if given:
        raise InputError(f"--boxes fine-tunes the close look that {options.model} has: leave out {' and '.join(given)}")
    example = "training.epochs=5"
    configuration = read_sections(TuningConfiguration, options.config, parse_overrides(options.set, example))
    source = BoxSource(options.boxes.resolve(), options.format, parse_names(options.names))
    found = source.read()
    for line in finding_lines(found.findings, False, f"vm-train check {options.boxes} --boxes --verbose lists all"):
        print(f"vm-train: {line}", file=sys.stderr)
    if options.strict and found.faults:
        raise InputError("some boxes can't be used, see above: repair them, or leave out --strict to skip them")
    with locked(options.output):
        run = begin_tuning(
            options.output,
            source,
            found,
            configuration,
            model_path(options.model),
            str(options.model),
            options.rendered,
            options.threads or 1,
        )
        _describe(run, options.boxes)
        return _fine_tune(run, options)


def _check_device(device: str) -> None:
    if device == "cuda":
        raise InputError("a fine-tuning runs on the CPU: give --device cpu, or leave it out")


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


def _fine_tune(run: TuningRun, options: argparse.Namespace) -> int:
    """Train from the last state of a fine-tuning on, and return the exit status.

    Raises KeyboardInterrupt after the step in which Ctrl-C or SIGTERM asked for a stop.
    """
    from ..learning.hardware import set_up_hardware
    from ..tuning.fine_tuning import fine_tune

    workers = options.workers or len(os.sched_getaffinity(0))
    with set_up_hardware("cpu", workers, options.threads or run.threads) as hardware:
        if hardware.size > 1:
            raise InputError("vm-train look runs in one process: start it without torchrun")
        with stop_requests() as stop_requested:
            finished = fine_tune(run, workers, stop_requested)
    if not finished:
        raise KeyboardInterrupt
    print(f"report: {run.folder / 'report.html'}")
    if run.split.test:
        names = "".join(f" {old}={new}" for old, new in run.boxes.names.items())
        frames = f"{run.boxes.folder}{names and ' --names' + names} --list {run.split_path}"
        print(f"next: vm-evaluate --boxes {frames} {run.model} {run.model_path} -o evaluation")
    print(f"next: vm-detect --model {run.model_path} {_frames_to_try(run)} --save-overlay found")
    return EXIT_OK
