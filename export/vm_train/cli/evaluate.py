"""vm-evaluate: scores of a network on pictures, for points and objects, by distance."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import vm_embedded
from vm_embedded.cli.program import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_OK, program
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError, VisualMeshError, not_installed
from vm_embedded.network.bundled import model_path
from vm_workstation.stopping import stoppable

from .evaluate_boxes import run_boxes
from .evaluate_calibrate import run_calibrate
from .evaluate_options import boxes_parser, calibrate_parser
from .evaluate_options import parser as parser
from .evaluate_options import parsers as parsers
from .evaluating import detector_settings, evaluate_with_progress, other_radii

if TYPE_CHECKING:
    from vm_embedded.network.look_contract import LookContract

    from ..evaluation.answers import Subject
    from ..evaluation.evaluation import Evaluation


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-evaluate and return its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with stoppable():
            if given[:1] == ["calibrate"]:
                return run_calibrate(calibrate_parser().parse_args(given[1:]))
            if any(each.partition("=")[0] == "--boxes" for each in given):
                asks = {"-h", "--help"}.intersection(given)  # --boxes alone would want its folder first
                return run_boxes(boxes_parser().parse_args(["--help"] if asks else given))
            return _evaluate(parser().parse_args(given))
    except ImportError as error:
        print(f"vm-evaluate: {not_installed(error, 'train')}", file=sys.stderr)
    except VisualMeshError as error:
        print(f"vm-evaluate: {' '.join(str(error).split())}", file=sys.stderr)
    except KeyboardInterrupt:
        print("vm-evaluate: stopped", file=sys.stderr)
        sys.stdout.flush()
        os._exit(EXIT_INTERRUPTED)  # the workers end with this process; a normal exit might wait for them forever
    return EXIT_FAILED


def _evaluate(options: argparse.Namespace) -> int:
    # Imported here: without torch or matplotlib, help works and the error is one clear line.
    from vm_workstation.plots import new_figure

    from ..evaluation.evaluation import Rules
    from ..evaluation.files import check_evaluation_folder, write_evaluation
    from ..evaluation.mask_colors import classes_with_colors, default_colors
    from ..evaluation.picture_selection import select_pictures
    from ..evaluation.points_on_ball_plot import median_camera_figure
    from ..evaluation.summary import lines
    from ..evaluation.workers import Job

    if options.format not in (None, "bgr"):
        raise InputError(f"--format must be bgr, not {options.format}: vm-evaluate reads all pictures as bgr")
    options.model = model_path(options.model)
    settings = detector_settings(options)
    pictures = select_pictures(options.data, options.list, options.part)
    rules = Rules(options.radius_of, options.strict)
    check_evaluation_folder(options.output, (options.model, options.list, options.config))
    new_figure(1.0, 1.0)  # fails now, not after an hour, if matplotlib is missing
    subject = _subject(options, settings)
    classes = classes_with_colors(subject.manifest, default_colors(options.model, options.list), options.color)
    job = Job(options.model, settings, options.as_robot, classes, rules)
    result = evaluate_with_progress(job, subject, pictures, options.workers)
    about = _about(options, settings, subject, job.classes.colors)
    about["notes"] = _notes(options, settings, subject, result)
    figure, about["camera"] = median_camera_figure(result.poses, job.classes, subject.manifest, subject.grid)
    scores = write_evaluation(options.output, result, about, settings.threshold, figure)
    print(lines(scores))
    for note in about["notes"]:
        print(f"vm-evaluate: {note}", file=sys.stderr)
    print(f"\n{options.output / 'report.html'}: written; scores.json, tables and plots are beside it")
    return EXIT_OK


def _subject(options: argparse.Namespace, settings: Settings) -> Subject:
    from ..evaluation.answers import load_subject

    if options.radius_of == "scene" and (options.as_robot or settings.object_radius is not None):
        raise InputError(
            "--radius-of scene makes a mesh for each picture's ball: it can't be combined with --as-robot or "
            "--object-radius"
        )
    return load_subject(options.model, settings, options.as_robot)


def _about(options: argparse.Namespace, settings: Settings, subject: Subject, colors: Any) -> dict[str, Any]:
    """Model, data, rules and settings, for scores.json."""
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
            **({} if manifest.look is None else _about_look(manifest.look)),
        },
        "data": {
            "folders": [str(each) for each in options.data],
            "list": None if options.list is None else str(options.list),
            "part": options.part if options.list is not None and options.list.suffix == ".json" else None,
            "colors": [f"{name} {list(map(list, each))}" for name, each in colors.items()],
        },
        "rules": {"radius_of": options.radius_of, "as_robot": options.as_robot},
        "settings": asdict(settings),
    }


def _about_look(look: LookContract) -> dict[str, Any]:
    """The close look of a model, for scores.json."""
    name = f"close look at {', '.join(look.names)}"
    return {
        name: f"{look.size} x {look.size} samples, extent {look.extent:g} radii, at most {look.max_proposals} peaks "
        "of a class",
        f"{name}, channels": list(look.channels),
        **{f"{name}, provenance {key}": value for key, value in look.provenance.items()},
    }


def _notes(options: argparse.Namespace, settings: Settings, subject: Subject, result: Evaluation) -> list[str]:
    """Remarks that help to understand the scores."""
    notes = []
    if not subject.grid.is_visual:
        notes.append(f"A network of a {subject.grid.kind} grid has scores of points only; objects need a Visual Mesh.")
    if options.radius_of == "all":
        notes += other_radii(result, settings.object_radius or subject.manifest.object_radius)
    if options.radius_of == "scene":
        notes.append("--radius-of scene: the detector was given the radius of each picture's ball.")
    return notes


if __name__ == "__main__":
    sys.exit(main())
