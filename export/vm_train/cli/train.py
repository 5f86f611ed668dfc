"""vm-train: train a network, resume a training, and look at the pictures it learns from."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence

from vm_embedded.cli.program import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_OK, discard_output, program
from vm_embedded.config.sections import read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import VisualMeshError, not_installed
from vm_embedded.files import check_writable
from vm_workstation.stopping import stoppable

from ..data.picture_files import paths_of
from ..data.pictures import find_pictures
from ..learning.configuration import HEADER, TrainConfiguration
from ..learning.folder_access import kind_of
from .check import run_check
from .check_boxes import refuse_other_options, run_check_boxes
from .fine_tuning import print_tune_config, resume_fine_tuning
from .import_boxes import run_import_boxes
from .import_pictures import run_import
from .look import print_look_config, resume_look, run_look
from .options import parsers
from .training import find_good_pictures, read_configuration, run_resume, run_training

_TRAININGS = (None, "look", "resume")
"""Commands whose work vm-train resume continues."""


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-train and return its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    commands: dict[str, Callable[[argparse.Namespace], int]] = {
        "look": run_look,
        "resume": _resume,
        "check": _check,
        "preview": _preview,
        "rate": _rate,
        "config": _config,
        "look-config": print_look_config,
        "tune-config": print_tune_config,
        "import": run_import,
        "import-boxes": run_import_boxes,
    }
    command = given[0] if given[:1] and given[0] in commands else None
    prog = "vm-train" if command is None else f"vm-train {command}"
    options = parsers()[prog].parse_args(given if command is None else given[1:])
    try:
        with stoppable():
            return run_training(options) if command is None else commands[command](options)
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


def _how_to_continue(command: str | None, options: argparse.Namespace) -> str:
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
    """Resume the training of a network or of a close look, or a fine-tuning."""
    from ..look.run_folder import KIND as LOOK
    from ..tuning.run_folder import KIND as TUNING

    kind = kind_of(options.run)
    if kind == TUNING:
        return resume_fine_tuning(options)
    return resume_look(options) if kind == LOOK else run_resume(options)


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
    from pathlib import Path
    from tempfile import TemporaryDirectory

    import torch

    from vm_export.mesh_networks import new_network

    from ..data.split import Split
    from ..learning.hardware import set_up_hardware
    from ..learning.rate_finder import check_plot, find_rate, plot_rates
    from ..learning.run_folder import begin_run
    from ..learning.training_data import TrainingData

    configuration = read_configuration(options)
    if options.plot is not None:
        check_plot(options.plot, (options.config, *paths_of(find_pictures(options.data))))
    with set_up_hardware(options.device, options.workers, options.threads) as hardware, TemporaryDirectory() as folder:
        good = find_good_pictures(options.data, configuration, hardware, strict=False)
        data = TrainingData(options.data, Split(tuple(each.number for each in good), (), ()))
        run = begin_run(Path(folder) / "run", data, configuration)
        torch.manual_seed(configuration.training.seed)
        found = find_rate(run, hardware, new_network(configuration.network_shape), options.steps)
    for position in range(0, len(found.rates), max(len(found.rates) // 12, 1)):
        print(f"rate {found.rates[position]:.1e}  loss {found.losses[position]:.4f}")
    print(f"proposed: training.rate = {found.proposed:.2g}")
    if options.plot is not None:
        plot_rates(found, options.plot)
    return EXIT_OK


def _config(options: argparse.Namespace) -> int:
    print(to_commented_toml(TrainConfiguration(), HEADER), end="")
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
