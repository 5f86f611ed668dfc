"""vm-mesh: what a mesh looks like, how evenly it samples, and how far out it is worth its points."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vm_embedded.errors import VisualMeshError, unknown
from vm_embedded.geometry.make_shape import SHAPES
from vm_embedded.mesh.models import MESH_MODELS

EXIT_OK, EXIT_FAILED, EXIT_USAGE, EXIT_INTERRUPTED = 0, 1, 2, 130

_EPILOG = "Exit status: 0 done, 1 not done (the reason is on standard error), 2 wrong usage."


def parsers() -> dict[str, argparse.ArgumentParser]:
    """A parser for each command."""
    show = _parser("show", "Draw a mesh: from above, by direction, or on a picture.")
    show.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="picture to write, .png or .svg")
    show.add_argument("--view", choices=("ground", "directions"), help="default ground, of wall6 directions")
    show.add_argument("--reach", type=float, metavar="M", help="draw points so far out [m]; default 2")
    show.add_argument(
        "--object", type=float, action="append", metavar="M", help="also draw an object at a distance [m]; repeatable"
    )
    picture = show.add_argument_group("on a picture")
    picture.add_argument("--image", type=Path, metavar="FILE", help="picture to draw on; needs --lens")
    _add_camera(picture)

    quality = _parser("quality", "Points on an object over its distance and bearing, and how the links of a mesh lie.")
    quality.add_argument("-o", "--output", type=Path, metavar="FILE", help="plot to write, .png or .svg")
    quality.add_argument("--json", type=Path, metavar="FILE", help="write all figures there")
    quality.add_argument(
        "--distance", type=float, action="append", metavar="M", help="distances [m]; default 0 to the mesh's end"
    )

    far = _parser("range", "How many pixels and points fall on an object, and how far out a mesh is worth its points.")
    _add_camera(far)
    _add_size(far)
    far.add_argument("--distance", type=float, action="append", metavar="M", help="distances [m]; default 0.5 to 20")
    far.add_argument("-o", "--output", type=Path, metavar="FILE", help="plot to write, .png or .svg")

    compare = _parser("compare", "Mesh models side by side: points, evenness, links, and the time to build them.")
    _add_camera(compare)
    _add_size(compare)
    compare.add_argument("--json", type=Path, metavar="FILE", help="write all figures there")
    return {"show": show, "quality": quality, "range": far, "compare": compare}


def _parser(command: str, description: str) -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(prog=f"vm-mesh {command}", description=description, epilog=_EPILOG)
    many = command in ("quality", "compare")
    if command != "range":
        made.add_argument(
            "--model",
            choices=tuple(MESH_MODELS),
            action="append",
            metavar="NAME",
            help="mesh model; " + ("repeatable, default all that fit the shape" if many else "default ring6"),
        )
    what = made.add_argument_group("what the mesh is made for")
    what.add_argument("--network", metavar="FILE", help="take all of it from a network (.onnx), or one of the package")
    what.add_argument("--shape", choices=tuple(SHAPES), help="of the object; default sphere")
    what.add_argument("--radius", type=float, metavar="M", help="of the object [m]; default 0.095")
    what.add_argument("--object-height", type=float, metavar="M", help="of a cylinder [m]")
    what.add_argument("--height", metavar="M", help="of the camera [m]; default that of --lens, or 1")
    what.add_argument("--intersections", type=float, metavar="K", help="points in a row across an object; default 4")
    what.add_argument(
        "--max-distance",
        type=float,
        metavar="M",
        help="how far out the mesh reaches on the plane [m]; default 10",
    )
    return made


def _add_camera(group: Any) -> None:
    group.add_argument("--lens", type=Path, metavar="FILE", help="lens file; its orientation counts if it has one")
    group.add_argument("--pitch", metavar="ANGLE", help="angle of the optical axis below the horizon, as in 20deg")
    group.add_argument("--roll", metavar="ANGLE", help="lean of the camera to the right")


def _add_size(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--size", metavar="WxH", help="size of pictures [px]; default the lens file's")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-mesh and return its exit status."""
    from .commands import COMMANDS

    given = list(sys.argv[1:] if arguments is None else arguments)
    known = parsers()
    if not given or given[0] in ("-h", "--help"):
        print("usage: vm-mesh COMMAND ...\n\ncommands, each with a --help of its own:")
        print("\n".join(f"  {name:9s}{each.description}" for name, each in known.items()))
        return EXIT_OK if given else EXIT_USAGE
    if given[0] not in known:
        print(f"vm-mesh: {unknown('command', given[0], known)}", file=sys.stderr)
        return EXIT_USAGE
    options = known[given[0]].parse_args(given[1:])
    try:
        COMMANDS[given[0]](options)
    except VisualMeshError as error:
        print(f"vm-mesh: {error}", file=sys.stderr)
        return EXIT_FAILED
    except KeyboardInterrupt:
        print("vm-mesh: stopped", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # who reads has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
