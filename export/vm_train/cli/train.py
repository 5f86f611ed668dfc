"""vm-train: train a network, go on with it, and look at what it is trained on."""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.cli.progress import ProgressBar
from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.files import check_writable
from vm_workstation.stopping import stoppable

from ..data.inspection import inspect_pictures
from ..data.picture_files import PictureFiles
from ..data.pictures import find_pictures
from ..data.split import Split, split_by_lists, split_by_seed
from ..learning.configuration import TrainConfiguration
from .check import complaints, run_check
from .import_pictures import run_import
from .options import parsers
from .shards import run_shards
from .stream_options import stream_source

if TYPE_CHECKING:
    from ..learning.hardware import Hardware
    from ..learning.run_folder import TrainingRun

_FEW = 10.0
"""Points of a picture that give gradients; with fewer a training is told to be slow."""

EXIT_OK, EXIT_FAILED, EXIT_INTERRUPTED = 0, 1, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-train and return its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    commands: dict[str, Callable[[argparse.Namespace], int]] = {
        "resume": _resume,
        "check": _check,
        "preview": _preview,
        "rate": _rate,
        "config": _config,
        "import": run_import,
        "shards": run_shards,
    }
    command = given[0] if given[:1] and given[0] in commands else None
    prog = "vm-train" if command is None else f"vm-train {command}"
    options = parsers()[prog].parse_args(given if command is None else given[1:])
    try:
        with stoppable():
            return _train(options) if command is None else commands[command](options)
    except VisualMeshError as error:
        if _speaks():
            print(f"vm-train: {' '.join(str(error).split())}", file=sys.stderr)
        return EXIT_FAILED
    except KeyboardInterrupt:
        if _speaks():
            print("vm-train: stopped", file=sys.stderr)
        sys.stdout.flush()
        os._exit(EXIT_INTERRUPTED)  # the workers end with this process, which else might wait for them in vain


def _speaks() -> bool:
    """Whether this is the process that reports, of those that torchrun started."""
    return os.environ.get("RANK", "0") == "0"


@contextmanager
def _on_request() -> Iterator[Callable[[], bool]]:
    """Whether Ctrl-C or SIGTERM asked to stop; the step in work is finished. The same one again stops at once."""
    asked: list[int] = []

    def ask(number: int, frame: object) -> None:
        if number in asked:  # torchrun sends one after the other
            raise KeyboardInterrupt
        asked.append(number)

    before = {each: signal.signal(each, ask) for each in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(asked)
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def _configuration(options: argparse.Namespace) -> TrainConfiguration:
    configuration = read_sections(TrainConfiguration, options.config, parse_overrides(options.set, "training.epochs=5"))
    _ = configuration.manifest  # raises ModelError for what fits no model file, before anything takes time
    return configuration


def _train(options: argparse.Namespace) -> int:
    from ..learning.hardware import set_up_hardware

    configuration = _configuration(options)
    with set_up_hardware(options.device, options.workers, options.threads) as here:
        # One process prepares; the others wait for what came of it.
        fault = here.broadcast(_fault_of(lambda: _begin(options, configuration, here)) if here.is_leader else None)
        if fault is not None:
            raise InputError(fault)
        return _go_on(options.output, here)


def _fault_of(work: Callable[[], object]) -> str | None:
    try:
        work()
    except VisualMeshError as error:
        return str(error)
    return None


def _begin(options: argparse.Namespace, configuration: TrainConfiguration, here: Hardware) -> TrainingRun:
    """Check all pictures, and write down a new training."""
    from ..learning.run_folder import TrainingRun, check_unused

    check_unused(options.output)
    source = stream_source(options, configuration, here)
    good = _good_pictures(options.data, configuration, here, options.strict)
    if source is None:
        split = _split(options, configuration, good)
        training = str(len(split.training))
    else:
        split = Split((), tuple(each.number for each in good))
        training = f"{source.epoch} an epoch of {len(source.shards)} shards"
    parts = f"{training} for training, {len(split.validation)} for validation, {len(split.test)} for test"
    print(f"{options.data}: {len(good)} pictures: {parts}")
    unpacked = None if options.no_unpacked else options.unpacked or options.output / "unpacked"
    job = TrainingRun.begin(
        options.output, options.data, configuration, split, unpacked, source, options.first, options.teacher
    )
    if job.points_a_picture < _FEW:
        print(
            f"vm-train: only {job.points_a_picture:.1f} points of a picture give gradients, as many of each class "
            "as the rarest object has; training.selection=all takes all",
            file=sys.stderr,
        )
    return job


def _good_pictures(data: Path, configuration: TrainConfiguration, here: Hardware, strict: bool) -> list[PictureFiles]:
    pictures = find_pictures(data)
    bar = ProgressBar(len(pictures), "vm-train")
    try:
        found = inspect_pictures(pictures, configuration.classes.mask_classes(), here.workers + 1, bar.advance)
    finally:
        bar.clear()
    for line in complaints(found):
        print(f"vm-train: {line}", file=sys.stderr)
    if strict and complaints(found):
        raise InputError("the pictures are at fault, as said above, and --strict allows none")
    if not found.good:
        raise InputError(f"no picture of {data} can be used")
    return list(found.good)


def _split(options: argparse.Namespace, configuration: TrainConfiguration, good: Sequence[PictureFiles]) -> Split:
    numbers = [each.number for each in good]
    if options.training or options.validation or options.test:
        return split_by_lists(numbers, options.training, options.validation, options.test)
    data = configuration.data
    return split_by_seed(numbers, data.validation, data.test, data.split_seed)


def _resume(options: argparse.Namespace) -> int:
    from ..learning.hardware import set_up_hardware

    with set_up_hardware(options.device, options.workers, options.threads) as here:
        return _go_on(options.run, here, options.data)


def _go_on(folder: Path, here: Hardware, moved_to: Path | None = None) -> int:
    from ..learning.rounds import train
    from ..learning.run_folder import TrainingRun, locked

    job = TrainingRun.read(folder)
    if moved_to is not None:
        job = replace(job, data=moved_to.resolve())
    if job.source is not None and job.source.workers != here.workers:
        here = replace(here, workers=job.source.workers)
        if here.is_leader:
            print(f"vm-train: {here.workers} workers read the stream, as run.json says", file=sys.stderr)
    with locked(folder) if here.is_leader else nullcontext(), _on_request() as stopped:
        done = train(job, here, stopped)
    if not here.is_leader:
        return EXIT_OK if done.finished else EXIT_INTERRUPTED
    speed = f"{done.pictures / max(done.seconds, 1e-9):.0f} pictures/s"
    if not done.finished:
        print(f"vm-train: stopped; vm-train resume {folder} goes on", file=sys.stderr)
        return EXIT_INTERRUPTED
    if job.unpacked is not None and job.unpacked.parent.resolve() == folder.resolve():
        shutil.rmtree(job.unpacked, ignore_errors=True)
    best = done.progress.best_ever
    print(f"{job.model_path}: average precision {best:.3f} on the validation, {speed}" * (done.pictures > 0), end="")
    print("" if done.pictures else f"{job.model_path}: the training was finished already")
    if job.split.test:
        print(f"next: vm-evaluate {job.model_path} {job.data} --list {folder / 'pictures.json'} --part test -o report")
    print(f"next: vm-export {job.model_path}")
    return EXIT_OK


def _check(options: argparse.Namespace) -> int:
    classes = read_sections(TrainConfiguration, options.config).classes
    objects = [name for name, kind in classes.kinds.items() if kind == "object"]
    return run_check(options, classes.mask_classes(), objects)


def _preview(options: argparse.Namespace) -> int:
    from vm_workstation.contact_sheet import choose_indices, write_sheet

    from ..data.pictures import read_picture
    from .preview import sheet

    configuration = _configuration(options)
    check_writable(options.output)
    pictures = find_pictures(options.data)
    classes = configuration.classes.mask_classes()
    picked = [pictures[each] for each in choose_indices(range(len(pictures)), options.count, None, options.seed)]
    shown = [read_picture(each, classes) for each in picked]
    made = sheet(
        shown,
        configuration.manifest,
        configuration.grid,
        configuration.augmentation,
        options.seed,
        options.versions,
        options.width,
    )
    write_sheet(options.output, made)
    print(f"{options.output}: {len(shown)} pictures, {options.versions} versions of each")
    return EXIT_OK


def _rate(options: argparse.Namespace) -> int:
    from tempfile import TemporaryDirectory

    import torch

    from vm_export.network import Network

    from ..learning.hardware import set_up_hardware
    from ..learning.rate_finder import check_plot, find_rate, plot_rates
    from ..learning.run_folder import TrainingRun

    configuration = _configuration(options)
    if options.plot is not None:
        check_plot(options.plot)
    with set_up_hardware(options.device, options.workers, options.threads) as here, TemporaryDirectory() as folder:
        good = _good_pictures(options.data, configuration, here, strict=False)
        split = Split(tuple(each.number for each in good), (), ())
        job = TrainingRun.begin(Path(folder) / "run", options.data, configuration, split, None)
        torch.manual_seed(configuration.training.seed)
        found = find_rate(job, here, Network(configuration.network_shape), options.steps)
    for position in range(0, len(found.rates), max(len(found.rates) // 12, 1)):
        print(f"rate {found.rates[position]:.1e}  loss {found.losses[position]:.4f}")
    print(f"proposed: training.rate = {found.proposed:.2g}")
    if options.plot is not None:
        plot_rates(found, options.plot)
    return EXIT_OK


def _config(options: argparse.Namespace) -> int:
    print(to_commented_toml(TrainConfiguration()), end="")
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
