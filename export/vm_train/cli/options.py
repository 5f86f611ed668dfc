"""The options that commands of vm-train share, and those of training a mesh network."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from vm_embedded.cli.program import Parser
from vm_embedded.network.bundled import SHIPPED
from vm_workstation.option_types import add_device, add_set, at_least

from ..runs.configuration import KINDS, configuration_name

SET_EXAMPLE = "training.epochs=5"

_EPILOG = """\
other commands (add --help for their options):
  vm-train mesh DATA             the same as vm-train DATA
  vm-train look DATA             train the close look, which judges proposals
  vm-train tune FRAMES           fine-tune a network on your own frames
  vm-train check DATA            count what the pictures show, list damaged ones
  vm-train resume RUN            continue a training that was stopped
  vm-train preview DATA          draw augmented pictures with points of the mesh
  vm-train rate DATA             find a learning rate
  vm-train import FILES OUT      unpack tar archives, convert TFRecord files
  vm-train import-boxes DIR OUT  make masks of frames with boxes, lens and pose
  vm-train config KIND           print a configuration with all its entries

Exit status: 0 success, 1 failure (see standard error), 2 usage, 130 stopped
"""


def mesh_parser() -> argparse.ArgumentParser:
    """The options of vm-train DATA."""
    made = Parser(
        commands=tuple(dict.fromkeys(re.findall(r"vm-train ([a-z-]+)", _EPILOG))),
        prog="vm-train",
        usage="vm-train DATA -o RUN [options]",  # all of them would fill half a screen
        description="Train a network on pictures with masks, lenses and poses. You can stop or kill\nit at any time: "
        "vm-train resume continues.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_data(made)
    add_output(made)
    add_configuration(made)
    add_start(made)
    _add_pictures(made)
    add_hardware(made)
    return made


def resume_parser() -> argparse.ArgumentParser:
    """The options of vm-train resume."""
    made = Parser(
        prog="vm-train resume",
        description="Continue a training that was stopped or killed, from its last state.",
    )
    made.add_argument("run", type=Path, metavar="RUN", help="folder of the training")
    made.add_argument("--data", type=Path, metavar="DATA", help="new folder of the pictures, if they were moved")
    add_hardware(made)
    return made


def preview_parser() -> argparse.ArgumentParser:
    """The options of vm-train preview."""
    made = Parser(
        prog="vm-train preview",
        description="Draw pictures with the points of the mesh in the colors of their classes, without and with "
        "augmentation. The rows below show each kind of augmentation alone.",
    )
    add_data(made)
    add_configuration(made)
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
    add_data(made)
    add_configuration(made)
    made.add_argument("--steps", type=at_least(20), default=200, metavar="N", help="number of steps; default 200")
    made.add_argument("--plot", type=Path, metavar="FILE", help="plot of the loss over the rate, .png or .svg")
    add_hardware(made)
    return made


def config_parser() -> argparse.ArgumentParser:
    """The options of vm-train config."""
    made = Parser(
        prog="vm-train config",
        description="Print the configuration of a training with all entries, their meanings, units, limits and "
        "defaults.",
    )
    made.add_argument(
        "kind", nargs="?", choices=KINDS, default=KINDS[0], metavar="KIND", help="mesh, look or tune; default: mesh"
    )
    return made


def add_start(made: argparse.ArgumentParser) -> None:
    """Add --from."""
    made.add_argument(
        "--from",
        dest="start",
        metavar="MODEL",
        help=f"begin with this network: .pt, .onnx, or {', '.join(SHIPPED)}; its classes, mesh and layers become "
        "defaults",
    )


def add_data(made: argparse.ArgumentParser) -> None:
    """Add DATA: pictures with masks."""
    made.add_argument("data", type=Path, metavar="DATA", help="folder of imageX.jpg or .png, maskX.png, lensX.yaml")


def add_output(made: argparse.ArgumentParser) -> None:
    """Add --output."""
    made.add_argument("-o", "--output", type=Path, required=True, metavar="RUN", help="new folder for the training")


def add_configuration(made: argparse.ArgumentParser, kind: str = "mesh") -> None:
    """Add --config and --set for a kind of training."""
    name = configuration_name(kind)
    made.add_argument("--config", type=Path, metavar="FILE", help=f"{name}; missing entries keep their defaults")
    add_set(made, SET_EXAMPLE)


def _add_pictures(made: argparse.ArgumentParser) -> None:
    group = made.add_argument_group("pictures")
    group.add_argument("--strict", action="store_true", help="fail if a picture is damaged; default: skip it")
    group.add_argument("--training", type=Path, metavar="FILE", help="list of pictures; default: split by [data]")
    for part in ("validation", "test"):
        group.add_argument(f"--{part}", type=Path, metavar="FILE", help=f"the same, for {part}")
    cache = group.add_mutually_exclusive_group()
    cache.add_argument(
        "--unpacked",
        type=Path,
        metavar="DIR",
        help="cache of decoded pictures; default RUN/unpacked",
    )
    cache.add_argument("--no-unpacked", action="store_true", help="no such cache; for slow or small disks")


def add_hardware(made: argparse.ArgumentParser) -> None:
    """Add what trains and how much of it."""
    group = made.add_argument_group("hardware")
    add_device(group)
    group.add_argument(
        "--workers",
        type=at_least(0),
        metavar="N",
        help="processes that read pictures; default: by the cores",
    )
    group.add_argument(
        "--threads",
        type=at_least(1),
        metavar="N",
        help="default 1; with more, results vary in the last digits",
    )
