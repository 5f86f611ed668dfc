"""The options of vm-train and its other commands."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from vm_embedded.cli.program import Parser
from vm_embedded.network.bundled import SHIPPED
from vm_workstation.option_types import add_set, at_least

from .check import check_parser
from .device_option import add_device
from .fine_tuning import tune_config_parser
from .import_boxes import import_boxes_parser
from .import_pictures import import_parser
from .look import look_config_parser, look_parser
from .shards import shards_parser
from .stream_options import add_stream

_EPILOG = """\
other commands (add --help for their options):
  vm-train look DATA           train the close look of a network: it judges the network's proposals
  vm-train look --boxes DIR    fine-tune the close look of a model file on your own frames
  vm-train look-config         print a look.toml with all entries and their defaults
  vm-train tune-config         print a tune.toml, the configuration of a fine-tuning
  vm-train resume RUN          continue a training that was stopped
  vm-train check DATA          count what the pictures show, and list the damaged ones
  vm-train preview DATA        draw augmented pictures with the points of the mesh
  vm-train rate DATA           find a learning rate
  vm-train config              print a train.toml with all entries and their defaults
  vm-train import FILES OUT    convert TFRecord files of the reference implementation to pictures
  vm-train import-boxes DIR OUT  convert frames with boxes, lens and pose to pictures with masks
  vm-train shards DATA OUT     pack pictures into tar files

On several GPUs or machines: torchrun --nproc-per-node=N -m vm_train DATA -o RUN
Exit status: 0 success, 1 failure (standard error tells why), 2 wrong usage, 130 stopped.
"""


def parser() -> argparse.ArgumentParser:
    """The options of vm-train DATA."""
    made = Parser(
        commands=tuple(re.findall(r"^  vm-train (\S+)", _EPILOG, re.MULTILINE)),
        prog="vm-train",
        description="Train a network on a folder of pictures with masks, lenses and poses. It first checks all "
        "pictures. You can stop or kill it at any time: vm-train resume continues. With one thread on a CPU, the final "
        "network is the same as without the stop.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_data(made)
    made.add_argument("-o", "--output", type=Path, required=True, metavar="RUN", help="new folder for the training")
    _add_configuration(made)
    add_start(made)
    made.add_argument("--strict", action="store_true", help="fail if a picture is damaged; default: skip it")
    add_stream(made)
    _add_lists(made)
    _add_cache(made)
    _add_hardware(made)
    return made


def resume_parser() -> argparse.ArgumentParser:
    """The options of vm-train resume."""
    made = Parser(
        prog="vm-train resume",
        description="Continue a training that was stopped or killed, from its last state.",
    )
    made.add_argument("run", type=Path, metavar="RUN", help="folder of the training")
    made.add_argument("--data", type=Path, metavar="DATA", help="new folder of the pictures, if they were moved")
    _add_hardware(made)
    return made


def preview_parser() -> argparse.ArgumentParser:
    """The options of vm-train preview."""
    made = Parser(
        prog="vm-train preview",
        description="Draw pictures with the points of the mesh in the colors of their classes, without and with "
        "augmentation. The rows below show each kind of augmentation alone.",
    )
    _add_data(made)
    _add_configuration(made)
    made.add_argument("--count", type=at_least(1), default=4, metavar="N", help="number of pictures; default 4")
    made.add_argument(
        "--versions", type=at_least(1), default=5, metavar="N", help="augmented versions of each picture; default 5"
    )
    made.add_argument("--seed", type=at_least(0), default=0, metavar="S", help="random seed; default 0")
    made.add_argument("--width", type=at_least(1), default=320, metavar="PX", help="width of each picture; default 320")
    made.add_argument(
        "-o", "--output", type=Path, default=Path("preview.jpg"), metavar="FILE", help="file to write, .jpg or .png"
    )
    return made


def rate_parser() -> argparse.ArgumentParser:
    """The options of vm-train rate."""
    made = Parser(
        prog="vm-train rate",
        description="Train for some steps with an increasing learning rate until the loss increases. Propose a rate.",
    )
    _add_data(made)
    _add_configuration(made)
    made.add_argument("--steps", type=at_least(20), default=200, metavar="N", help="number of steps; default 200")
    made.add_argument("--plot", type=Path, metavar="FILE", help="plot of the loss over the rate, .png or .svg")
    _add_hardware(made)
    return made


def config_parser() -> argparse.ArgumentParser:
    """The parser of vm-train config, which has no options."""
    return Parser(
        prog="vm-train config",
        description="Print a train.toml with all entries, their meanings, units, limits and defaults.",
    )


def parsers() -> dict[str, argparse.ArgumentParser]:
    """All parsers, by command."""
    made = (
        parser(),
        look_parser(),
        look_config_parser(),
        tune_config_parser(),
        resume_parser(),
        check_parser(),
        preview_parser(),
        rate_parser(),
        config_parser(),
        import_parser(),
        import_boxes_parser(),
        shards_parser(),
    )
    return {each.prog: each for each in made}


def add_start(made: argparse.ArgumentParser) -> None:
    """Add --from."""
    made.add_argument(
        "--from",
        dest="start",
        metavar="MODEL",
        help="begin with the weights of a trained network, not with random ones: a checkpoint (.pt), a model file "
        f"(.onnx), or a network of the package ({', '.join(SHIPPED)}). Its classes, mesh and layers, and "
        "training.rate 0.001, become the defaults of the configuration",
    )


def _add_data(made: argparse.ArgumentParser) -> None:
    made.add_argument("data", type=Path, metavar="DATA", help="folder of imageX.jpg or .png, maskX.png, lensX.yaml")


def _add_configuration(made: argparse.ArgumentParser) -> None:
    made.add_argument(
        "--config", type=Path, metavar="FILE", help="configuration, train.toml; missing entries keep their defaults"
    )
    add_set(made, "training.epochs=5")


def _add_lists(made: argparse.ArgumentParser) -> None:
    lists = made.add_argument_group(
        "lists of pictures", "Text files with a picture number or image name on each line; default: split by [data]."
    )
    for part in ("training", "validation", "test"):
        lists.add_argument(f"--{part}", type=Path, metavar="FILE", help=f"list of pictures for {part}")


def _add_cache(made: argparse.ArgumentParser) -> None:
    group = made.add_mutually_exclusive_group()
    group.add_argument(
        "--unpacked",
        type=Path,
        metavar="DIR",
        help="cache folder for decoded pictures (1.3 MB per picture of 640 x 512 px); several trainings can share it; "
        "default RUN/unpacked, which is removed at the end",
    )
    group.add_argument(
        "--no-unpacked", action="store_true", help="do not cache decoded pictures; for slow or small disks"
    )


def _add_hardware(made: argparse.ArgumentParser) -> None:
    group = made.add_argument_group("hardware")
    add_device(group)
    group.add_argument(
        "--workers",
        type=at_least(0),
        metavar="N",
        help="processes that read pictures; default: half of the cores; with a GPU, all cores but one",
    )
    group.add_argument(
        "--threads",
        type=at_least(1),
        metavar="N",
        help="computing threads; default 1; with more, the last digits of results differ from run to run",
    )
