"""vm-train: train a network, resume a training, and look at the pictures it learns from."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

from vm_embedded.cli.program import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_OK, discard_output, program
from vm_embedded.config.sections import read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import VisualMeshError, not_installed
from vm_embedded.files import check_writable
from vm_workstation.stopping import stoppable

from ..data.picture_files import paths_of
from ..data.pictures import find_pictures
from ..learning.configuration import TrainConfiguration
from ..look.configuration import LookConfiguration
from ..runs.configuration import KINDS, header
from ..runs.run import kind_of
from ..tuning.configuration import TuningConfiguration
from .check import check_parser, run_check
from .check_boxes import refuse_other_options, run_check_boxes
from .import_boxes import import_boxes_parser, run_import_boxes
from .import_pictures import import_parser, run_import
from .look import look_parser, resume_look, run_look
from .mesh import find_good_pictures, read_configuration, resume_mesh, run_mesh
from .options import config_parser, mesh_parser, preview_parser, rate_parser, resume_parser
from .tune import resume_tune, run_tune, tune_parser


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-train and return its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    command = given.pop(0) if given[:1] and given[0] in COMMANDS else "mesh"
    parser, work = COMMANDS[command]
    options = parser().parse_args(given)
    try:
        with stoppable():
            return work(options)
    except ImportError as error:
        if _is_leader():
            print(f"vm-train: {not_installed(error, 'train')}", file=sys.stderr)
        return EXIT_FAILED
    except VisualMeshError as error:
        if _is_leader():
            print(f"vm-train: {' '.join(str(error).split())}", file=sys.stderr)
        return EXIT_FAILED
    except BrokenPipeError:
        discard_output()
        if _is_leader() and command in _TRAININGS:
            remedy = _how_to_continue(command, options)
            print(f"vm-train: stopped, because nothing reads its output{remedy}", file=sys.stderr)
            os._exit(EXIT_INTERRUPTED)  # as below
        return EXIT_OK
    except KeyboardInterrupt:
        if _is_leader():
            print(f"vm-train: stopped{_how_to_continue(command, options)}", file=sys.stderr)
        sys.stdout.flush()
        os._exit(EXIT_INTERRUPTED)  # ends the workers, too; a normal exit might wait for them forever


def _how_to_continue(command: str, options: argparse.Namespace) -> str:
    """The end of a message about a stop: the command that continues a training, once its folder holds one."""
    if command not in _TRAININGS:
        return ""
    folder = options.run if command == "resume" else options.output
    begun = folder is not None and (folder / "run.json").exists()
    return f"; continue with vm-train resume {folder}" if begun else ""


def _is_leader() -> bool:
    """Whether this is the process that reports, of those that torchrun started."""
    return os.environ.get("RANK", "0") == "0"


def _resume(options: argparse.Namespace) -> int:
    """Resume a training of any kind."""
    resume = {"mesh": resume_mesh, "look": resume_look, "tune": resume_tune}
    return resume[kind_of(options.run)](options)


def _check(options: argparse.Namespace) -> int:
    refuse_other_options(options)
    if options.boxes:
        return run_check_boxes(options)
    classes = read_sections(TrainConfiguration, options.config).classes
    objects = [name for name, kind in classes.kinds.items() if kind == "object"]
    return run_check(options, classes.mask_classes(), objects)


def _preview(options: argparse.Namespace) -> int:
    from vm_workstation.contact_sheet import choose_indices, write_sheet

    from ..data.pictures import read_picture
    from .preview import sheet

    configuration = read_configuration(options)
    pictures = find_pictures(options.data)
    check_writable(options.output, (options.config, *paths_of(pictures)))
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
    import torch

    from vm_export.mesh_networks import new_network

    from ..data.split import Split
    from ..learning.rate_finder import check_plot, find_rate, plot_rates
    from ..learning.run import MeshRun
    from ..runs.hardware import set_up_hardware

    configuration = read_configuration(options)
    if options.plot is not None:
        check_plot(options.plot, (options.config, *paths_of(find_pictures(options.data))))
    with set_up_hardware(options.device, options.workers, options.threads) as hardware:
        good = find_good_pictures(options.data, configuration, hardware, strict=False)
        split = Split(tuple(each.number for each in good), (), ())
        run = MeshRun(options.data, {}, 1, split, options.data, configuration).with_counts()
        torch.manual_seed(configuration.training.seed)
        found = find_rate(run, hardware, new_network(configuration.network_shape), options.steps)
    for position in range(0, len(found.rates), max(len(found.rates) // 12, 1)):
        print(f"rate {found.rates[position]:.1e}  loss {found.losses[position]:.4f}")
    print(f"proposed: training.rate = {found.proposed:.2g}")
    if options.plot is not None:
        plot_rates(found, options.plot)
    return EXIT_OK


def _config(options: argparse.Namespace) -> int:
    print(to_commented_toml(CONFIGURATIONS[options.kind](), header(options.kind)), end="")
    return EXIT_OK


CONFIGURATIONS: dict[str, Callable[[], Any]] = {
    "mesh": TrainConfiguration,
    "look": LookConfiguration,
    "tune": TuningConfiguration,
}
"""The configuration of each kind of training."""

COMMANDS: dict[str, tuple[Callable[[], argparse.ArgumentParser], Callable[[argparse.Namespace], int]]] = {
    "mesh": (mesh_parser, run_mesh),
    "look": (look_parser, run_look),
    "tune": (tune_parser, run_tune),
    "resume": (resume_parser, _resume),
    "check": (check_parser, _check),
    "preview": (preview_parser, _preview),
    "rate": (rate_parser, _rate),
    "config": (config_parser, _config),
    "import": (import_parser, run_import),
    "import-boxes": (import_boxes_parser, run_import_boxes),
}
"""The parser and the work of each command; without one, vm-train trains a mesh network."""

_TRAININGS = (*KINDS, "resume")
"""Commands whose work vm-train resume continues."""


def parsers() -> dict[str, argparse.ArgumentParser]:
    """All parsers, by command."""
    return {made.prog: made for made in (parser() for parser, _ in COMMANDS.values())}


if __name__ == "__main__":
    sys.exit(main())
