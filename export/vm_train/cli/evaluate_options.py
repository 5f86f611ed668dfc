"""The options of vm-evaluate; they need nothing heavy, so that its help is quick."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from vm_embedded.cli.options import add_settings
from vm_workstation.option_types import at_least

_EPILOG = """\
another command, with a --help of its own:
  vm-evaluate points      the paper's figure of points on a ball over its distance, without a network

Exit status: 0 written, 1 not written (the reason is on standard error), 2 wrong usage, 130 interrupted.
"""


def parser() -> argparse.ArgumentParser:
    """The options of vm-evaluate MODEL DATA."""
    made = argparse.ArgumentParser(
        prog="vm-evaluate",
        description="Measure a network on pictures with masks: scores of points and of objects, by distance, as JSON, "
        "CSV, plots and one page of HTML.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("model", type=Path, metavar="MODEL", help="a checkpoint (.pt) or a model file (.onnx)")
    made.add_argument("data", type=Path, nargs="+", metavar="DATA", help="folder of imageX, maskX.png and lensX.yaml")
    made.add_argument("-o", "--output", type=Path, required=True, metavar="OUT", help="folder to write to")
    which = made.add_argument_group("pictures")
    which.add_argument("--list", type=Path, metavar="FILE", help="numbers of pictures, or pictures.json of vm-train")
    which.add_argument("--part", choices=("test", "validation", "training"), help="part of pictures.json; default test")
    which.add_argument(
        "--color",
        type=_color,
        action="append",
        default=[],
        metavar="CLASS=R,G,B",
        help="a further color that masks have for a class, beside those of the train.toml next to the checkpoint, or "
        "else of vm-synth",
    )
    which.add_argument(
        "--radius-of",
        choices=("all", "scene"),
        default="all",
        help="all: mesh and fit are for the network's radius; scene: for that of each picture's ball, from the "
        "sceneX.json of vm-synth; default all",
    )
    which.add_argument(
        "--min-radius", type=_length, default=2.0, metavar="PX", help="smaller objects are ignored [px]; default 2"
    )
    which.add_argument("--strict", action="store_true", help="stop at a picture that can't be used; default skip it")
    how = made.add_argument_group("how")
    how.add_argument(
        "--as-robot", action="store_true", help="with meshes shared between poses, as a robot does; .onnx only"
    )
    how.add_argument("--workers", type=at_least(1), metavar="N", help="processes, of one core each; default all cores")
    how.add_argument("--config", type=Path, metavar="FILE", help="vm.toml, whose settings options below override")
    add_settings(made)
    return made


def points_parser() -> argparse.ArgumentParser:
    """The options of vm-evaluate points."""
    made = argparse.ArgumentParser(
        prog="vm-evaluate points",
        description="Draw how many points of the Visual Mesh and of a hexagonal mesh of the same size fall on a ball, "
        "over its distance, for a camera like that of the paper: 1280 x 1024 px, equisolid, f = 420 px.",
    )
    made.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="a .png or .svg")
    made.add_argument("--intersections", type=_numbers, default=(3.0, 4.0, 5.0), metavar="K,...", help="default 3,4,5")
    made.add_argument("--radius", type=_length, default=0.075, metavar="M", help="of the ball [m]; default 0.075")
    made.add_argument("--height", type=_length, default=0.9, metavar="M", help="of the camera [m]; default 0.9")
    made.add_argument("--pitch", type=float, default=45.0, metavar="DEG", help="of the camera [deg]; default 45")
    made.add_argument(
        "--equal-at",
        type=_length,
        metavar="M",
        help="distance at which both meshes have as many points on the ball [m]; default: as many in all",
    )
    made.add_argument("--early", action="store_true", help="also rings as wide as an early version had them")
    return made


def parsers() -> dict[str, argparse.ArgumentParser]:
    """All parsers, by what is typed."""
    return {each.prog: each for each in (parser(), points_parser())}


def _color(text: str) -> tuple[str, tuple[int, int, int]]:
    name, _, values = text.rpartition("=")
    parts = values.split(",")
    if not name or len(parts) != 3 or not all(each.strip().isdecimal() and int(each) < 256 for each in parts):
        raise argparse.ArgumentTypeError(f"{text!r} is no color of a class; write CLASS=R,G,B, as ball=255,0,0")
    red, green, blue = map(int, parts)
    return name, (red, green, blue)


def _length(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of at least 0")
    return value


def _numbers(text: str) -> tuple[float, ...]:
    values = tuple(_length(each) for each in text.split(","))
    if not all(values):
        raise argparse.ArgumentTypeError(f"{text!r} must be numbers above 0, as 3,4,5")
    return values
