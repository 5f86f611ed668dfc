"""vm-train mesh: train a mesh network, or resume such a training."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.cli.progress import ProgressBar
from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.errors import InputError
from vm_embedded.field.features import UPRIGHTS
from vm_embedded.files import exists
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model

from ..data.inspection import inspect_pictures
from ..data.picture_files import PictureFiles
from ..data.pictures import find_pictures
from ..data.split import Split, split_by_lists, split_by_seed
from ..learning.configuration import TrainConfiguration
from .check import complaints
from .training import run_training

if TYPE_CHECKING:
    from ..learning.start import Start
    from ..learning.training import MeshTraining
    from ..runs.hardware import Hardware

UNPACKED = "unpacked"
"""Folder in that of a training, for the cache of decoded pictures that is removed at the end."""

_FEW = 10.0
"""Selected points per picture; with fewer, vm-train warns."""


def run_mesh(options: argparse.Namespace) -> int:
    """Begin the training of a mesh network, train, and return the exit status. Raises VisualMeshError."""
    start = load_start(options.start)
    configuration = read_configuration(options, start)

    def begin(hardware: Hardware) -> None:
        _begin(options, configuration, hardware, start)

    return run_training(options, options.output, partial(_load, options.output, None), _report, begin)


def resume_mesh(options: argparse.Namespace) -> int:
    """Resume a training and return the exit status. Raises VisualMeshError."""
    return run_training(options, options.run, partial(_load, options.run, options.data), _report)


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
    from ..learning.run import FILES, begin_run
    from ..runs.run import check_unused

    check_unused(options.output, FILES)
    good = find_good_pictures(options.data, configuration, hardware, options.strict)
    split = _split(options, configuration, good)
    counts = f"{len(split.training)} for training, {len(split.validation)} for validation, {len(split.test)} for test"
    print(f"{options.data}: {len(good)} pictures: {counts}")
    if remark := _without_bases(configuration, good):
        print(f"vm-train: {remark}", file=sys.stderr)
    unpacked = None if options.no_unpacked else options.unpacked or options.output / UNPACKED
    threads = options.threads or 1
    run = begin_run(options.output, options.data, split, configuration, unpacked=unpacked, start=start, threads=threads)
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


def _load(folder: Path, moved_to: Path | None, hardware: Hardware) -> MeshTraining:
    """The training of a folder. moved_to: where its pictures are now. Raises InputError or ModelError."""
    from ..learning.run import read_run
    from ..learning.training import MeshTraining

    run = read_run(folder, moved_to)
    if hardware.is_leader:
        objects = [name for name, kind in run.configuration.classes.kinds.items() if kind == "object"]
        print(
            f"validation AP: average precision of the mesh points of {' and '.join(objects) or 'all classes'} in the "
            "validation pictures, from 0 to 1; the network with the highest is kept",
            flush=True,
        )
    return MeshTraining(run, hardware)


def _report(training: MeshTraining) -> None:
    """Print the commands to use next; remove the cache that the training made for itself."""
    from ..graphs.graph_cache import remove_caches

    run, model = training.run, training.run.result_path
    if run.unpacked is not None and run.unpacked.resolve() == run.folder.resolve() / UNPACKED:
        remove_caches(run.unpacked)
    if run.split.test:
        radius = " --radius-of scene" if run.configuration.mesh.radius_of == "scene" else ""
        pictures = f"--list {run.folder / 'pictures.json'} --part test"
        print(f"next: vm-evaluate {model} {run.data} {pictures}{radius} -o report")
    if run.configuration.mesh.grid == "hexagonal":  # it can't be exported
        return
    start = run.folder / "start.onnx"
    if start.exists() and read_model(start).manifest.look:
        print(f"next: vm-export {model} --look {start}")
        return
    if "object" in run.configuration.classes.kinds.values():
        print(f"next: vm-train look {run.data} --from {model} -o {run.folder}-look")
    print(f"next: vm-export {model}")
