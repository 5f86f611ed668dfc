"""vm-calibrate: estimates lens and pose of a camera, and writes them as vm-detect reads them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vm_embedded.cli.program import Parser, program
from vm_workstation.commands import Commands, run_command
from vm_workstation.option_types import at_least

LENS_NAMES = ("auto", "pinhole", "fisheye", "rectilinear", "equisolid", "equidistant")
"""What --lens takes; without `auto` the kinds of lens_kinds.py, which loads OpenCV."""

_EPILOG = "Exit status: 0 done, 1 not done (standard error says why), 2 wrong usage, 130 interrupted."


def parsers() -> dict[str, argparse.ArgumentParser]:
    """The argument parsers of the commands."""
    board = _parser("board", "Draw a chessboard or ChArUco board in its true size, to print.", "drawing to write, .svg")
    _add_board(board)

    lens = _parser("lens", "Estimate the lens of a camera from a chessboard or ChArUco board in a video or pictures.")
    lens.add_argument("source", metavar="SOURCE", help="video, folder of pictures, or glob in quotes")
    _add_board(lens)
    lens.add_argument(
        "--lens",
        choices=LENS_NAMES,
        default="auto",
        help="kind of lens: OpenCV's pinhole or fisheye, or a radial one of the reference; default auto, which takes "
        "the better of pinhole and fisheye",
    )
    lens.add_argument(
        "--frames",
        type=at_least(5),
        default=40,
        metavar="N",
        help="most frames to use for the fit; default %(default)s",
    )
    lens.add_argument(
        "--fov",
        metavar="ANGLE",
        help="full angle that a radial lens covers, as in 185deg; default: to the corners of the picture",
    )

    kalibr = _parser("kalibr", "Convert the lens of a camera from a file of Kalibr (camchain.yaml).")
    kalibr.add_argument("source", type=Path, metavar="FILE", help="file of Kalibr")
    kalibr.add_argument("--camera", metavar="NAME", help="camera of the file, as in cam0; needed if it has several")

    pose = _parser(
        "pose",
        "Estimate height, pitch and roll of a fixed camera from balls or a board on the floor, or from a film of a "
        "field; or constant errors of a stream of poses from a recording of a field.",
        "lens file to write, .yaml; with --field and a recording also the vm.toml to write, .toml",
    )
    pose.add_argument(
        "source",
        nargs="?",
        metavar="SOURCE",
        help="with --board or --field: video, folder or picture of the board on the floor, or of the field",
    )
    pose.add_argument(
        "--lens", type=Path, metavar="FILE", help="lens file of the camera; the frames of a recording have their own"
    )
    _add_field(pose)
    balls = pose.add_argument_group("balls on the floor")
    balls.add_argument(
        "--balls",
        type=Path,
        metavar="PATH",
        help="folder of pictures with boxes in YOLO format, or a JSON file of outlines or boxes",
    )
    balls.add_argument(
        "--radius",
        type=float,
        metavar="M",
        help="radius of the balls [m]; default: from the JSON file, with --field that of the network",
    )
    balls.add_argument(
        "--label",
        metavar="CLASS",
        help="class of the balls: in YOLO files its name in the table of names (classes.txt), or its number without a "
        "table; in a JSON file the entry class; default: all boxes",
    )
    balls.add_argument(
        "--size", metavar="WxH", help="size of the pictures of a JSON file [px]; default: from the lens file"
    )
    _add_board(pose)
    pose.add_argument(
        "--thickness", type=float, default=0.0, metavar="M", help="thickness of the board [m]; default %(default)g"
    )

    photo = _parser("photo", "Estimate height, pitch and roll of a camera from one photo of a field.", needed=False)
    photo.add_argument("source", metavar="PHOTO", help="image that shows lines of a field, and a ball if possible")
    photo.add_argument("--lens", type=Path, metavar="FILE", help="lens file of the camera")
    photo.add_argument("--fov", metavar="ANGLE", help="instead: the horizontal angle of view, such as 70deg")
    photo.add_argument("--radius", type=float, metavar="M", help="radius of the ball [m]; default: the network's")
    _add_line_width(photo)
    return {"board": board, "lens": lens, "kalibr": kalibr, "pose": pose, "photo": photo}


def _parser(
    command: str, description: str, output: str = "lens file to write, .yaml", needed: bool = True
) -> argparse.ArgumentParser:
    made = Parser(prog=f"vm-calibrate {command}", description=description, epilog=_EPILOG)
    made.add_argument("-o", "--output", type=Path, required=needed, metavar="FILE", help=output)
    return made


def _add_field(parser: argparse.ArgumentParser) -> None:
    field = parser.add_argument_group("a field")
    field.add_argument(
        "--field", action="store_true", help="SOURCE shows a field: use its lines, and balls on the floor"
    )
    _add_line_width(field)


def _add_line_width(made: argparse._ActionsContainer) -> None:
    made.add_argument(
        "--line-width",
        type=float,
        metavar="M",
        help="width of the lines [m], such as 0.05; without it, only balls tell the height",
    )


def _add_board(parser: argparse.ArgumentParser) -> None:
    needed: dict[str, Any] = {} if parser.prog.endswith("pose") else {"required": True}
    board = parser.add_argument_group("board")
    board.add_argument(
        "--board",
        metavar="WxH",
        help="inner corners of a chessboard, as in 9x6: where four squares meet; squares of a ChArUco board",
        **needed,
    )
    board.add_argument(
        "--square",
        type=float,
        metavar="M",
        help="side of a square [m]"
        + (
            "; default 1, as only its proportion to --marker matters for a lens" if parser.prog.endswith("lens") else ""
        ),
    )
    board.add_argument(
        "--charuco", metavar="DICT", help="the board is a ChArUco board with markers of this dictionary, as in 4X4_50"
    )
    board.add_argument("--marker", type=float, metavar="M", help="side of a marker of a ChArUco board [m]")
    board.add_argument(
        "--legacy", action="store_true", help="the ChArUco board is from a program with an OpenCV before 4.6"
    )


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-calibrate and return its exit status."""
    return run_command("vm-calibrate", parsers(), _load, "calibrate", arguments)


def _load() -> Commands:
    from vm_embedded.cameras.library_messages import silence_opencv

    from .commands import COMMANDS

    silence_opencv()
    return COMMANDS


if __name__ == "__main__":
    sys.exit(main())
