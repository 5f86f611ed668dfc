"""vm-mesh: draws meshes and measures how evenly they sample and how far they are of use."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vm_embedded.cli.program import Parser, program
from vm_embedded.geometry.shapes import SHAPES
from vm_embedded.mesh.models import MESH_MODELS
from vm_embedded.network.bundled import DEFAULT
from vm_workstation.commands import Commands, run_command

_EPILOG = "Exit status: 0 done, 1 not done (standard error says why), 2 wrong usage, 130 interrupted."


def parsers() -> dict[str, argparse.ArgumentParser]:
    """The argument parsers of the commands. Long, because it lists every option."""
    show = _parser("show", "Draw a mesh from above, by direction, or on a picture.")
    show.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="drawing to write, .png or .svg")
    show.add_argument(
        "--view",
        choices=("ground", "directions"),
        help="ground: from above; directions: by bearing and inclination. Default ground, or directions for wall6",
    )
    show.add_argument("--reach", type=float, metavar="M", help="draw points up to this distance [m]; default 2")
    show.add_argument(
        "--object", type=float, action="append", metavar="M", help="draw an object at this distance [m]; repeatable"
    )
    picture = show.add_argument_group("on a picture")
    picture.add_argument(
        "--image",
        type=Path,
        metavar="FILE",
        help="picture to draw on; needs --lens, and takes no --view, --reach and --object",
    )
    _add_camera(picture)

    quality = _parser(
        "quality",
        "Measure how evenly a mesh samples: points on an object over distance and bearing, and lengths of links.",
    )
    quality.add_argument("-o", "--output", type=Path, metavar="FILE", help="plot to write, .png or .svg")
    quality.add_argument("--json", type=Path, metavar="FILE", help="file for all numbers, as JSON")
    quality.add_argument(
        "--distance",
        type=float,
        action="append",
        metavar="M",
        help="distance of the object [m]; repeatable; default 60 distances within the reach",
    )

    far = _parser(
        "range",
        "Show pixels and points on an object over distance, and the distance beyond which neighboring mesh points are "
        "less than a pixel apart, so that they repeat each other's colors.",
    )
    far.add_argument("--lens", type=Path, metavar="FILE", help="lens file; its Hoc is the default of --height")
    _add_size(far)
    far.add_argument(
        "--distance",
        type=float,
        action="append",
        metavar="M",
        help="distance of the object [m]; repeatable; default ten from 0.5 to 20",
    )
    far.add_argument("-o", "--output", type=Path, metavar="FILE", help="plot to write, .png or .svg")

    compare = _parser("compare", "Compare mesh models: number of points, evenness, links, and time to build.")
    _add_camera(compare)
    _add_size(compare)
    compare.add_argument("--json", type=Path, metavar="FILE", help="file for all numbers, as JSON")
    return {"show": show, "quality": quality, "range": far, "compare": compare}


def _parser(command: str, description: str) -> argparse.ArgumentParser:
    made = Parser(prog=f"vm-mesh {command}", description=description, epilog=_EPILOG)
    several = command in ("quality", "compare")
    if command != "range":
        made.add_argument(
            "--model",
            choices=tuple(MESH_MODELS),
            action="append",
            metavar="NAME",
            help="mesh model; "
            + ("repeatable; default: all models for the shape" if several else "default: that of --network"),
        )
    plan = made.add_argument_group("object, camera and reach")
    plan.add_argument(
        "--network",
        metavar="FILE",
        help="take the defaults of this group from a network: an .onnx file, or the name of one in the package; "
        f"default {DEFAULT}, as for vm-detect",
    )
    plan.add_argument("--shape", choices=tuple(SHAPES), help="shape of the object")
    plan.add_argument("--radius", type=float, metavar="M", help="radius of the object [m]")
    plan.add_argument(
        "--object-height", type=float, metavar="M", help="height of the object [m]; only a cylinder takes it"
    )
    plan.add_argument(
        "--height",
        metavar="M",
        help="height of the camera [m]; default: " + ("1" if command == "quality" else "from the lens file, or 1"),
    )
    plan.add_argument(
        "--intersections", type=float, metavar="K", help="rings of points across an object (the paper's k)"
    )
    plan.add_argument(
        "--max-distance",
        type=float,
        metavar="M",
        help="reach of the mesh on the plane [m]",
    )
    return made


def _add_camera(group: Any) -> None:
    group.add_argument(
        "--lens", type=Path, metavar="FILE", help="lens file; its orientation is the default of --pitch and --roll"
    )
    group.add_argument("--pitch", metavar="ANGLE", help="angle of the optical axis below the horizon, as in 20deg")
    group.add_argument("--roll", metavar="ANGLE", help="angle by which the camera leans to the right")


def _add_size(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--size", metavar="WxH", help="size of the pictures [px]; default: from the lens file")


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-mesh and return its exit status."""
    return run_command("vm-mesh", parsers(), _load, "train", arguments)


def _load() -> Commands:
    from .commands import COMMANDS

    return COMMANDS


if __name__ == "__main__":
    sys.exit(main())
