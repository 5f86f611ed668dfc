"""vm-train look: train the close look of a mesh network, or resume such a training."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.cli.program import Parser
from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.network.bundled import SHIPPED, model_path

from ..data.class_table import ClassTable
from ..data.pictures import find_pictures
from ..data.split import split_beside, split_by_seed
from ..look.configuration import LookConfiguration
from .options import SET_EXAMPLE, add_configuration, add_data, add_hardware, add_output
from .training import run_training

if TYPE_CHECKING:
    from ..look.training import LookTraining
    from ..runs.hardware import Hardware


def look_parser() -> argparse.ArgumentParser:
    """The options of vm-train look."""
    made = Parser(
        prog="vm-train look",
        description="Train the close look of a mesh network: a small network that judges a patch of the picture at "
        "each peak of the mesh network. You can stop or kill it at any time: vm-train resume continues. On a CPU, "
        "the final network is the same as without the stop.",
    )
    add_data(made)
    made.add_argument(
        "--from",
        type=Path,
        required=True,
        dest="model",
        metavar="MODEL",
        help="mesh network whose peaks it judges: a checkpoint (.pt), a model file (.onnx), or a network of the "
        f"package ({', '.join(SHIPPED)})",
    )
    add_output(made)
    add_configuration(made, "look")
    made.add_argument("--strict", action="store_true", help="fail if a picture is damaged; default: skip it")
    add_hardware(made)
    return made


def run_look(options: argparse.Namespace) -> int:
    """Begin the training of a close look, train, and return the exit status. Raises VisualMeshError."""
    from ..look.run import begin_look_run

    model = model_path(options.model)
    given = read_sections(LookConfiguration, options.config, parse_overrides(options.set, SET_EXAMPLE))
    configuration = _with_classes_of(model, given)

    def begin(hardware: Hardware) -> None:
        numbers, data = [each.number for each in find_pictures(options.data)], configuration.data
        earlier = split_beside(model, options.data)
        split = split_by_seed(numbers, data.validation, 0.0, data.split_seed, earlier)
        begin_look_run(
            options.output,
            options.data,
            split,
            configuration,
            model,
            str(options.model),
            strict=options.strict,
            threads=options.threads or 1,
        )
        count = [len(each) for each in asdict(split).values()]
        parts = f"{count[0]} for training, {count[1]} for validation, {count[2]} for test"
        print(f"{options.data}: {sum(count)} pictures: {parts}", flush=True)

    return run_training(options, options.output, partial(_load, options.output, None), _report, begin, alone=True)


def _with_classes_of(model: Path, configuration: LookConfiguration) -> LookConfiguration:
    """The configuration with the classes of the train.toml beside the mesh network, unless it has classes of its own.

    Raises InputError if that train.toml can't be read.
    """
    beside = model.with_name("train.toml")
    if configuration.classes != ClassTable.default() or not beside.exists():
        return configuration
    return replace(configuration, classes=ClassTable.read(beside))


def resume_look(options: argparse.Namespace) -> int:
    """Resume the training of a close look and return the exit status. Raises VisualMeshError."""
    return run_training(options, options.run, partial(_load, options.run, options.data), _report, alone=True)


def _load(folder: Path, moved_to: Path | None, hardware: Hardware) -> LookTraining:
    """The training of a folder. moved_to: where its pictures are now. Raises InputError or ModelError."""
    from ..look.run import read_look_run
    from ..look.training import LookTraining

    return LookTraining(read_look_run(folder, moved_to), hardware)


def _report(training: LookTraining) -> None:
    """Print the command to use next."""
    run, look = training.run, training.run.result_path
    print(f"next: vm-export {run.mesh} --look {look} -o {run.folder / 'model.onnx'}")
