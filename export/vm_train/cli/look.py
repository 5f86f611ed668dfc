"""vm-train look: train the close look of a mesh network, or resume such a training."""

from __future__ import annotations

import argparse
import os
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.cli.program import EXIT_OK, Parser
from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError
from vm_embedded.network.bundled import SHIPPED, model_path
from vm_workstation.option_types import add_device, add_set, at_least
from vm_workstation.worker_process import check_shared_memory

from ..data.pictures import find_pictures
from ..data.split import split_beside, split_by_seed
from ..learning.class_table import ClassTable
from ..learning.folder_access import locked
from ..look.configuration import LOOK_HEADER, LookConfiguration
from .box_options import add_box_options
from .fine_tuning import begin_fine_tuning
from .training import stop_requests

if TYPE_CHECKING:
    from vm_export.look_checkpoint import LookCheckpoint


def look_parser() -> argparse.ArgumentParser:
    """The options of vm-train look."""
    made = Parser(
        prog="vm-train look",
        description="Train the close look of a mesh network: a small network that judges a patch of the picture at "
        "each peak of the mesh network. Or, with --boxes, fine-tune the one that a model file has, on the CPU. You "
        "can stop or kill it at any time: vm-train resume continues. On a CPU, the final network is the same as "
        "without the stop.",
    )
    made.add_argument(
        "data", type=Path, nargs="?", metavar="DATA", help="folder of imageX.jpg or .png, maskX.png, lensX.yaml"
    )
    made.add_argument(
        "--from",
        type=Path,
        required=True,
        dest="model",
        metavar="MODEL",
        help="mesh network whose peaks it judges: a checkpoint (.pt), a model file (.onnx), or a network of the "
        f"package ({', '.join(SHIPPED)})",
    )
    made.add_argument(
        "--start",
        metavar="LOOK",
        help="begin with the weights of a trained close look, not with random ones: a look.pt, a model file (.onnx), "
        f"or a network of the package ({', '.join(SHIPPED)}). Its patches and layers, and training.rate 0.005 "
        "become the defaults",
    )
    made.add_argument("-o", "--output", type=Path, required=True, metavar="RUN", help="new folder for the training")
    made.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="configuration, look.toml, or tune.toml with --boxes; missing entries keep their defaults",
    )
    add_set(made, "training.epochs=5")
    add_device(made)
    made.add_argument("--strict", action="store_true", help="fail if a picture is damaged; default: skip it")
    made.add_argument("--workers", type=at_least(1), metavar="N", help="processes that cut patches; default: all cores")
    made.add_argument(
        "--threads",
        type=at_least(1),
        metavar="N",
        help="computing threads; default 1; another number changes the last digits of results",
    )
    group = made.add_argument_group("fine-tuning", "Instead of DATA: boxes of your own frames, without lens and pose.")
    group.add_argument(
        "--boxes",
        type=Path,
        metavar="DIR",
        help="folder of frames with boxes, in YOLO, Pascal VOC or COCO format; the close look of the model file "
        "MODEL is fine-tuned on them",
    )
    add_box_options(group)
    group.add_argument(
        "--rendered",
        type=Path,
        metavar="RUN",
        help="folder of the vm-train look training that made the close look of MODEL; its patches are mixed in, so "
        "that the network forgets little; default: patches of the package, which show balls",
    )
    return made


def look_config_parser() -> argparse.ArgumentParser:
    """The parser of vm-train look-config, which has no options."""
    return Parser(
        prog="vm-train look-config",
        description="Print a look.toml with all entries, their meanings, units, limits and defaults.",
    )


def print_look_config(options: argparse.Namespace) -> int:
    """Print a look.toml with all defaults."""
    print(to_commented_toml(LookConfiguration(), LOOK_HEADER), end="")
    return EXIT_OK


def run_look(options: argparse.Namespace) -> int:
    """Begin the training of a close look, train, and return the exit status. Raises VisualMeshError."""
    from ..learning.hardware import check_device
    from ..look.run_folder import begin_look_run

    if (options.workers or len(os.sched_getaffinity(0))) > 1:
        check_shared_memory()
    if options.boxes is not None:
        return begin_fine_tuning(options)
    if options.data is None:
        raise InputError("give a folder of rendered pictures, DATA, or one of frames with boxes, --boxes DIR")
    if options.names or options.format or options.rendered:
        raise InputError("--names, --format and --rendered go with --boxes: leave them out, or give --boxes DIR")
    check_device(options.device)
    start, configuration = _start_and_configuration(options)
    model = model_path(options.model)
    configuration = _with_classes_of(model, configuration)
    numbers, data = [each.number for each in find_pictures(options.data)], configuration.data
    earlier = split_beside(model, options.data)
    split = split_by_seed(numbers, data.validation, 0.0, data.split_seed, earlier)
    with locked(options.output):
        run = begin_look_run(
            options.output,
            options.data,
            split,
            configuration,
            model,
            str(options.model),
            strict=options.strict,
            threads=options.threads or 1,
            start=start,
        )
        count = [len(each) for each in asdict(split).values()]
        parts = f"{count[0]} for training, {count[1]} for validation, {count[2]} for test"
        print(f"{options.data}: {sum(count)} pictures: {parts}", flush=True)
        return _train(run.folder, None, options)


def _start_and_configuration(options: argparse.Namespace) -> tuple[LookCheckpoint | None, LookConfiguration]:
    """The network of --start, and the configuration, whose defaults it changes. Raises InputError or ModelError."""
    from ..look.start import LookStart

    overrides = parse_overrides(options.set, "training.epochs=5")
    configuration = read_sections(LookConfiguration, options.config, overrides)  # tells the class to judge
    if options.start is None:
        return None, configuration
    start = LookStart.load(model_path(options.start), configuration.patches.object_class)
    configuration = read_sections(LookConfiguration, options.config, overrides, defaults=start.defaults)
    start.check(configuration)
    return start.look, configuration


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
    with locked(options.run):
        return _train(options.run, options.data, options)


def _train(folder: Path, moved_to: Path | None, options: argparse.Namespace) -> int:
    """Train from the last state of a folder on; moved_to: where the pictures are now. Returns the exit status.

    Raises KeyboardInterrupt after the step in which Ctrl-C or SIGTERM asked for a stop.
    """
    from ..learning.hardware import set_up_hardware
    from ..look.collected import collect
    from ..look.run_folder import read_look_run
    from ..look.training import is_finished, train_look

    run = read_look_run(folder)
    if moved_to is not None:
        run = replace(run, data=moved_to.resolve())
    workers = options.workers or len(os.sched_getaffinity(0))
    with set_up_hardware(options.device, workers, options.threads or run.threads) as hardware:
        if hardware.size > 1:
            raise InputError("vm-train look runs in one process: start it without torchrun")
        if is_finished(run):
            print(f"{run.look_path}: the training was finished already")
        else:
            collected = collect(run, workers)
            with stop_requests() as stop_requested:
                if not train_look(run, collected, hardware, stop_requested):
                    raise KeyboardInterrupt
    print(f"next: vm-export {run.mesh} --look {run.look_path} -o {folder / 'model.onnx'}")
    return EXIT_OK
