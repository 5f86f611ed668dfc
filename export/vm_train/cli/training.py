"""vm-train DATA and vm-train resume: begin a training, or resume one, and train until it ends or is stopped."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.cli.program import EXIT_OK
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.field.features import UPRIGHTS
from vm_embedded.files import exists
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_workstation.worker_process import check_shared_memory

from ..data.inspection import inspect_pictures
from ..data.picture_files import PictureFiles
from ..data.pictures import find_pictures
from ..data.split import Split, split_by_lists, split_by_seed
from ..learning.configuration import TrainConfiguration
from ..learning.folder_access import locked
from .check import complaints

if TYPE_CHECKING:
    from ..learning.hardware import Hardware
    from ..learning.rounds import TrainingOutcome
    from ..learning.run_folder import TrainingRun
    from ..learning.start import Start

UNPACKED = "unpacked"
"""Folder in that of a training, for the cache of decoded pictures that is removed at the end."""

_FEW = 10.0
"""Selected points per picture; with fewer, vm-train warns."""


def run_training(options: argparse.Namespace) -> int:
    """Begin a training, train, and return the exit status. Raises VisualMeshError."""
    from ..learning.hardware import set_up_hardware

    if options.workers != 0:
        check_shared_memory()
    start = load_start(options.start)
    configuration = read_configuration(options, start)
    with set_up_hardware(options.device, options.workers, options.threads) as hardware, ExitStack() as held:
        # The leader prepares everything; the other processes wait for its error message, or None.
        error = None
        if hardware.is_leader:

            def begin() -> None:
                held.enter_context(locked(options.output))
                _begin(options, configuration, hardware, start)

            error = _message_of_error(begin)
        error = hardware.broadcast(error)
        if error is not None:
            raise InputError(error)
        return _train(options.output, hardware)


def run_resume(options: argparse.Namespace) -> int:
    """Resume a training and return the exit status. Raises VisualMeshError."""
    from ..learning.hardware import set_up_hardware

    if options.workers != 0:
        check_shared_memory()
    with set_up_hardware(options.device, options.workers, options.threads) as hardware, ExitStack() as held:
        if hardware.is_leader:
            held.enter_context(locked(options.run))
        return _train(options.run, hardware, options.data)


def load_start(model: str | None) -> Start | None:
    """The network of --from: a name of the package, or a file. Raises InputError or ModelError."""
    if model is None:
        return None
    from ..learning.start import Start

    return Start.load(model_path(model))


def read_configuration(options: argparse.Namespace, start: Start | None = None) -> TrainConfiguration:
    """The configuration of --config and --set. Raises InputError, and ModelError if no model file could hold it.

    start: the network to begin with; what it describes takes the place of the defaults.
    """
    overrides = parse_overrides(options.set, "training.epochs=5")
    defaults = None if start is None else start.defaults
    configuration = read_sections(TrainConfiguration, options.config, overrides, defaults=defaults)
    _ = configuration.manifest  # raises ModelError now, before anything takes time
    if start is not None:
        start.check(configuration)
    return configuration


def find_good_pictures(
    data: Path, configuration: TrainConfiguration, hardware: Hardware, strict: bool
) -> list[PictureFiles]:
    """Check all pictures, report the damaged ones, and return the others.

    Raises InputError if no picture is left, or, with strict, if any is damaged.
    """
    pictures = find_pictures(data)
    bar = ProgressBar(len(pictures), "vm-train")
    try:
        found = inspect_pictures(pictures, configuration.classes.mask_classes(), hardware.workers + 1, bar.advance)
    finally:
        bar.clear()
    for line in complaints(found, verbose=False):
        print(f"vm-train: {line}", file=sys.stderr)
    if strict and found.faults:
        raise InputError("some pictures are damaged, see above: repair them, or leave out --strict to skip them")
    if not found.good:
        raise InputError(f"no picture of {data} can be used: vm-train check {data} tells why")
    return list(found.good)


def _begin(
    options: argparse.Namespace, configuration: TrainConfiguration, hardware: Hardware, start: Start | None
) -> None:
    """Check all pictures, and write the folder of a new training."""
    from ..learning.folder_access import check_unused
    from ..learning.run_folder import FILES, begin_run
    from ..learning.training_data import TrainingData

    check_unused(options.output, FILES)
    good = find_good_pictures(options.data, configuration, hardware, options.strict)
    split = _split(options, configuration, good)
    counts = f"{len(split.training)} for training, {len(split.validation)} for validation, {len(split.test)} for test"
    print(f"{options.data}: {len(good)} pictures: {counts}")
    if remark := _without_bases(configuration, good):
        print(f"vm-train: {remark}", file=sys.stderr)
    unpacked = None if options.no_unpacked else options.unpacked or options.output / UNPACKED
    data = TrainingData(options.data, split, unpacked)
    run = begin_run(options.output, data, configuration, start)
    if run.selected_points_per_picture < _FEW:
        print(
            f"vm-train: only {run.selected_points_per_picture:.1f} points of a picture give gradients, because each "
            "class gets as many as the rarest object; training.selection=all uses all points",
            file=sys.stderr,
        )


def _without_bases(configuration: TrainConfiguration, pictures: Sequence[PictureFiles]) -> str:
    """A remark if pictures don't tell where the uprights stand whose bases the network should learn; else ""."""
    names = [each for each in configuration.manifest.peaks if each in UPRIGHTS]
    missing = sum(not exists(each.scene) for each in pictures)
    if not names or not missing:
        return ""
    where = f"where the base of a {' or '.join(names)} is"
    return f"{missing} pictures have no sceneX.json: from them, the network does not learn {where}"


def _split(options: argparse.Namespace, configuration: TrainConfiguration, good: Sequence[PictureFiles]) -> Split:
    numbers = [each.number for each in good]
    if options.training or options.validation or options.test:
        return split_by_lists(numbers, options.training, options.validation, options.test)
    data = configuration.data
    return split_by_seed(numbers, data.validation, data.test, data.split_seed)


def _train(folder: Path, hardware: Hardware, moved_to: Path | None = None) -> int:
    """Train from the last state of a folder on; moved_to: where the pictures are now. Returns the exit status.

    Raises KeyboardInterrupt after the step in which Ctrl-C or SIGTERM asked for a stop.
    """
    from ..learning.rounds import train
    from ..learning.run_folder import read_run

    run = read_run(folder)
    if moved_to is not None:
        run = replace(run, data=replace(run.data, folder=moved_to.resolve()))
    if hardware.is_leader:
        objects = [name for name, kind in run.configuration.classes.kinds.items() if kind == "object"]
        print(
            f"validation AP: average precision of the mesh points of {' and '.join(objects) or 'all classes'} in the "
            "validation pictures, from 0 to 1; the network with the highest is kept",
            flush=True,
        )
    with stop_requests() as stop_requested:
        outcome = train(run, hardware, stop_requested)
    if not outcome.finished:
        raise KeyboardInterrupt
    if hardware.is_leader:
        _report(run, outcome)
    return EXIT_OK


def _report(run: TrainingRun, outcome: TrainingOutcome) -> None:
    """Print the result of a training and the commands to use next; remove the cache that it made for itself."""
    from ..graphs.graph_cache import remove_caches

    data, model = run.data, run.model_path
    if data.unpacked is not None and data.unpacked.resolve() == run.folder.resolve() / UNPACKED:
        remove_caches(data.unpacked)
    if outcome.pictures:
        speed = outcome.pictures / max(outcome.seconds, 1e-9)
        print(f"{model}: validation AP {outcome.progress.best_ever:.3f}, {speed:.0f} pictures/s")
    else:
        print(f"{model}: the training was finished already")
    if data.split.test:
        radius = " --radius-of scene" if run.configuration.mesh.radius_of == "scene" else ""
        pictures = f"--list {run.folder / 'pictures.json'} --part test"
        print(f"next: vm-evaluate {model} {data.folder} {pictures}{radius} -o report")
    if run.configuration.mesh.grid == "hexagonal":  # it can't be exported
        return
    start = run.folder / "start.onnx"
    if start.exists() and read_model(start).manifest.looks:
        print(f"next: vm-export {model} --look {start}")
        return
    if "object" in run.configuration.classes.kinds.values():
        print(f"next: vm-train look {data.folder} --from {model} -o {run.folder}-look")
    print(f"next: vm-export {model}")


def _message_of_error(work: Callable[[], object]) -> str | None:
    """Message of the VisualMeshError that work raises, or None."""
    try:
        work()
    except VisualMeshError as error:
        return str(error)
    return None


@contextmanager
def stop_requests() -> Iterator[Callable[[], bool]]:
    """Yield a function that tells whether Ctrl-C or SIGTERM has asked for a stop after the current step.

    The same signal once more stops at once; the other one does not, because torchrun sends one after the other.
    """
    received: list[int] = []

    def handle(number: int, frame: object) -> None:
        if number in received:
            raise KeyboardInterrupt
        received.append(number)

    before = {each: signal.signal(each, handle) for each in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(received)
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
