"""The options of vm-evaluate. This module imports nothing heavy, so the help appears at once."""

from __future__ import annotations

import argparse
from pathlib import Path

from vm_embedded.cli.options import add_settings
from vm_embedded.cli.program import Parser
from vm_workstation.option_types import at_least

from .box_options import add_box_options

_EPILOG = """\
other commands, with their own --help:
  vm-evaluate --boxes DIR MODEL [MODEL ...]
                          score what networks find in your own frames with boxes, side by side
  vm-evaluate calibrate   make the confidence of a model file fit pictures: of the objects that it finds with confidence
                          0.9, nine of ten are then right

Exit status: 0 files written, 1 error (see standard error), 2 wrong usage, 130 interrupted.
"""


def parser() -> argparse.ArgumentParser:
    """The options of vm-evaluate MODEL DATA."""
    made = Parser(
        commands=("calibrate",),
        prog="vm-evaluate",
        description="Evaluate a network on pictures with masks. Write scores of points and of objects, by distance, as "
        "JSON, CSV, plots and one HTML page.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument(
        "model",
        type=Path,
        metavar="MODEL",
        help="checkpoint (.pt), model file (.onnx), or one from the package: ball or soccer",
    )
    _add_data(made)
    made.add_argument(
        "-o", "--output", type=Path, required=True, metavar="OUT", help="folder to write to; created if missing"
    )
    _add_pictures(made)
    group = made.add_argument_group("evaluation")
    group.add_argument(
        "--as-robot",
        action="store_true",
        help="run the detector as on a robot, with meshes shared between similar poses; only for .onnx",
    )
    _add_workers(group)
    group.add_argument(
        "--config", type=Path, metavar="FILE", help="vm.toml with detector settings; the options below override them"
    )
    add_settings(made)
    return made


def boxes_parser() -> argparse.ArgumentParser:
    """The options of vm-evaluate --boxes."""
    made = Parser(
        prog="vm-evaluate --boxes",
        usage="vm-evaluate --boxes DIR [options] MODEL [MODEL ...]",
        description="Score what networks find in your own frames with boxes, side by side: for example a network "
        "before and after fine-tuning. If each frame has a lens file with a pose, this runs the whole detector. "
        "Otherwise, the close look alone searches the images. An object is found if its box and yours have an IoU of "
        "at least 0.5.",
    )
    made.add_argument(
        "models",
        nargs="*",  # an option --names before them takes them along; see run_boxes
        metavar="MODEL",
        help="model file (.onnx), or one from the package: ball or soccer",
    )
    made.add_argument(
        "--boxes",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder of frames with boxes, in YOLO, Pascal VOC or COCO format",
    )
    made.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="OUT",
        help="folder to write to: scores.json, and report.html with pictures of the worst errors; default: only print "
        "the scores",
    )
    made.add_argument(
        "--list",
        type=Path,
        metavar="FILE",
        help="evaluate only these frames: the pictures.json of a fine-tuning",
    )
    made.add_argument("--part", choices=("test", "validation", "training"), help="part of pictures.json; default test")
    add_box_options(made)
    _add_workers(made)
    made.add_argument(
        "--config", type=Path, metavar="FILE", help="vm.toml with detector settings; the options below override them"
    )
    add_settings(made, skip=("format",))
    return made


def calibrate_parser() -> argparse.ArgumentParser:
    """The options of vm-evaluate calibrate."""
    made = Parser(
        prog="vm-evaluate calibrate",
        description="Write a copy of a model file. It adjusts the confidence of each close look, so that nine of ten "
        "objects with confidence 0.9 are right. Use pictures that the network has not learned from. More or fewer "
        "objects may then pass --min-confidence.",
    )
    made.add_argument(
        "model",
        type=Path,
        metavar="MODEL",
        help="model file (.onnx) with a close look, or one from the package: ball or soccer",
    )
    _add_data(made)
    made.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="model file to write (.onnx)")
    _add_pictures(made)
    _add_workers(made)
    return made


def _add_data(made: argparse.ArgumentParser) -> None:
    made.add_argument(
        "data",
        type=Path,
        nargs="+",
        metavar="DATA",
        help="folder of imageX.jpg or .png, maskX.png and lensX.yaml",
    )


def _add_workers(made: argparse._ActionsContainer) -> None:
    made.add_argument("--workers", type=at_least(1), metavar="N", help="processes, one core each; default: all cores")


def _add_pictures(made: argparse.ArgumentParser) -> None:
    group = made.add_argument_group("pictures")
    group.add_argument(
        "--list",
        type=Path,
        metavar="FILE",
        help="evaluate only these pictures: a text file with one number or image name per line, or the pictures.json "
        "of a training",
    )
    group.add_argument("--part", choices=("test", "validation", "training"), help="part of pictures.json; default test")
    group.add_argument(
        "--color",
        type=_color,
        action="append",
        default=[],
        metavar="CLASS=R,G,B",
        help="assign one more mask color to a class; repeatable. The other colors come from the train.toml next to the "
        "checkpoint, or else from vm-synth",
    )
    group.add_argument(
        "--radius-of",
        choices=("all", "scene"),
        default="all",
        help="radius for the mesh, and for the search for the outline that fits best. all: the network's radius for "
        "all pictures; scene: the radius of each picture's ball (sceneX.json of vm-synth); default all",
    )
    group.add_argument(
        "--strict",
        action="store_true",
        help="stop at a picture that can't be used; default: skip it. An unknown color in a mask always stops",
    )


def parsers() -> dict[str, argparse.ArgumentParser]:
    """All parsers by command, as typed."""
    return {each.prog: each for each in (parser(), boxes_parser(), calibrate_parser())}


def _color(text: str) -> tuple[str, tuple[int, int, int]]:
    name, _, values = text.rpartition("=")
    parts = values.split(",")
    if not name or len(parts) != 3 or not all(each.strip().isdecimal() and int(each) < 256 for each in parts):
        raise argparse.ArgumentTypeError(f"{text!r}: write CLASS=R,G,B with values up to 255, for example ball=255,0,0")
    red, green, blue = map(int, parts)
    return name, (red, green, blue)
