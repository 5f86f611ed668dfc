"""vm-evaluate: how good a network is, over points and objects, by distance."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import vm_embedded
from vm_embedded.configuration import read_configuration
from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.options import add_settings
from vm_embedded.settings import Settings

if TYPE_CHECKING:
    from .answers import Subject
    from .evaluation import Evaluation

EXIT_OK, EXIT_FAILED, EXIT_INTERRUPTED = 0, 1, 130

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
    which.add_argument(
        "--part", choices=("test", "validation", "training"), default="test", help="part of pictures.json; default test"
    )
    which.add_argument(
        "--color",
        type=_color,
        action="append",
        default=[],
        metavar="CLASS=R,G,B",
        help="a further color that masks have for a class; without it those of vm-synth",
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
    how.add_argument("--workers", type=_workers, metavar="N", help="processes, of one core each; default all cores")
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-evaluate and return its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if given[:1] == ["points"]:
            return _points(points_parser().parse_args(given[1:]))
        return _evaluate(parser().parse_args(given))
    except ImportError as error:
        missing = error.name or str(error)
        print(f"vm-evaluate: {missing} is not installed; run: pip install 'vm-embedded[train]'", file=sys.stderr)
    except VisualMeshError as error:
        print(f"vm-evaluate: {' '.join(str(error).split())}", file=sys.stderr)
    except KeyboardInterrupt:
        print("vm-evaluate: stopped", file=sys.stderr)
        return EXIT_INTERRUPTED
    return EXIT_FAILED


def _evaluate(options: argparse.Namespace) -> int:
    # Imported here, so that a machine without torch still gets help texts and one clear line.
    from vm_synth.progress import Ticker

    from .evaluated_pictures import classes_of, pictures_of
    from .evaluation import Rules
    from .evaluation_files import points_on_object, write_evaluation
    from .evaluation_report import lines
    from .evaluation_workers import Job, evaluate
    from .figures import new_figure

    settings = _settings(options)
    pictures = pictures_of(options.data, options.list, options.part)
    rules = Rules(options.radius_of, options.min_radius, options.strict)
    if options.output.exists() and not options.output.is_dir():
        raise InputError(f"can't write to {options.output}: it is no folder")
    new_figure(1.0, 1.0)  # better no plots now than after an hour
    subject = _subject(options, settings)
    job = Job(options.model, settings, options.as_robot, classes_of(subject.manifest, options.color), rules)
    ticker = Ticker(len(pictures), "vm-evaluate")
    try:
        result = evaluate(job, subject, pictures, options.workers or len(os.sched_getaffinity(0)), ticker.count)
    finally:
        ticker.end()
    for path, fault in result.faults.items():
        print(f"vm-evaluate: skipped {path}: {fault}", file=sys.stderr)
    if not result.views:
        raise InputError("no picture could be evaluated")
    about = _about(options, settings, subject, job.classes.colors)
    about["notes"] = _notes(options, settings, subject, result)
    figure, about["camera"] = points_on_object(result.views, job.classes, subject.manifest, subject.grid)
    scores = write_evaluation(options.output, result, about, settings.threshold, figure)
    print(lines(scores))
    for note in about["notes"]:
        print(f"vm-evaluate: {note}", file=sys.stderr)
    print(f"\n{options.output / 'report.html'}: written, with scores.json, tables and plots beside it")
    return EXIT_OK


def _subject(options: argparse.Namespace, settings: Settings) -> Subject:
    from .answers import load_subject

    if options.radius_of == "scene" and (options.as_robot or settings.object_radius is not None):
        raise InputError(
            "--radius-of scene gives each picture a mesh of its own, so neither --as-robot nor "
            "--object-radius goes with it"
        )
    return load_subject(options.model, settings, options.as_robot)


def _settings(options: argparse.Namespace) -> Settings:
    configured = read_configuration(options.config).settings if options.config else {}
    given = {each.name: getattr(options, each.name) for each in fields(Settings)}
    if given["format"] not in (None, "bgr"):
        raise InputError(f"--format {given['format']} is for a robot's camera; pictures of a folder are read as bgr")
    chosen = {name: value for name, value in given.items() if value is not None}
    return Settings(**{**configured, **chosen, "format": "bgr"})


def _about(options: argparse.Namespace, settings: Settings, subject: Subject, colors: Any) -> dict[str, Any]:
    """What was evaluated, on what and how, for scores.json."""
    manifest, grid = subject.manifest, subject.grid
    return {
        "made_by": f"vm-evaluate {vm_embedded.__version__}",
        "model": {
            "file": options.model.name,
            "sha256": subject.sha256,
            "classes": [f"{each.name} ({each.kind})" for each in manifest.classes],
            "shape": manifest.shape,
            "radius": manifest.radius,
            "object_radius": manifest.object_radius,
            "intersections": manifest.intersections,
            "mesh": manifest.mesh,
            "max_distance": manifest.max_distance,
            "grid": grid.kind + (f", equal at {grid.equal_at:g} m" if grid.equal_at else ""),
            **{f"provenance {key}": value for key, value in manifest.provenance.items()},
        },
        "data": {
            "folders": [str(each) for each in options.data],
            "list": None if options.list is None else str(options.list),
            "part": options.part if options.list is not None and options.list.suffix == ".json" else None,
            "colors": [f"{name} {list(map(list, each))}" for name, each in colors.items()],
        },
        "rules": {"radius_of": options.radius_of, "min_radius": options.min_radius, "as_robot": options.as_robot},
        "settings": asdict(settings),
    }


def _notes(options: argparse.Namespace, settings: Settings, subject: Subject, result: Evaluation) -> list[str]:
    """What a reader of the scores should know."""
    notes = []
    if subject.grid.kind != "visual":
        notes.append(
            f"A network of a {subject.grid.kind} grid has scores of points only: objects are found in the Visual Mesh."
        )
    radius = settings.object_radius or subject.manifest.object_radius
    if options.radius_of == "all" and any(abs(each - radius) > 0.02 * radius for each in result.radii):
        low, high = min(result.radii), max(result.radii)
        found = f"radii from {low:.3f} to {high:.3f} m" if high > low else f"a radius of {low:.3f} m"
        notes.append(
            f"Balls in these pictures have {found}, and the fit is for {radius:g} m. --radius-of scene gives each "
            "picture mesh and fit for its own ball."
        )
    if options.radius_of == "scene":
        notes.append("Mesh and fit are for the radius of each picture's own ball.")
    return notes


def _points(options: argparse.Namespace) -> int:
    from vm_embedded.files import check_writable
    from vm_embedded.orientation import Orientation
    from vm_embedded.shapes import Sphere

    from .figures import check_figure_path, save_figure
    from .object_points import DISTANCES, PAPER_CAMERA, Camera, points_over_distance
    from .object_points_plot import points_figure

    check_figure_path(options.output)
    check_writable(options.output)
    pose = Orientation.from_roll_pitch(options.height, pitch=math.radians(options.pitch))
    camera = Camera(pose, PAPER_CAMERA.lens, PAPER_CAMERA.size)
    ball = Sphere(options.radius)
    curves = points_over_distance(camera, ball, options.intersections, DISTANCES[::2], options.equal_at, options.early)
    title = (
        f"camera {options.height:g} m high, {options.pitch:g} degrees down, "
        f"{camera.size[0]} x {camera.size[1]} px; ball of radius {options.radius:g} m"
    )
    save_figure(points_figure(curves, title), options.output)
    for curve in curves:
        shown = ", ".join(f"{curve.at(each)[0]:.1f} at {each:g} m" for each in (1.0, 2.0, 5.0, 10.0))
        print(f"{curve.mesh:9s}  k = {curve.intersections:g}, {curve.count} points on screen, on the ball {shown}")
    print(f"{options.output}: written")
    return EXIT_OK


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


def _workers(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least 1")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())
