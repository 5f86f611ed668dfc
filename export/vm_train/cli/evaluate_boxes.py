"""vm-evaluate --boxes: scores of networks on the user's own frames with boxes."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import vm_embedded
from vm_embedded.borders.text import printable
from vm_embedded.cli.program import EXIT_OK
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError, unknown
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import ModelFile, read_model
from vm_embedded.output.box_files import OBJECT, read_object_file

from ..boxes.box import BoxedPicture
from ..boxes.findings import finding_lines
from ..boxes.read import read_boxes
from ..data.split import read_split
from .box_options import parse_names
from .evaluating import detector_settings


def run_boxes(options: argparse.Namespace) -> int:
    """Score the networks, print a table, write the report, and return the exit status. Raises VisualMeshError."""
    from ..evaluation.box_report import box_lines, box_page
    from ..evaluation.files import check_evaluation_folder, write_box_evaluation
    from ..tuning.box_finding import LOOK_ALONE, WHOLE_DETECTOR, Search, Trial, judged_class
    from ..tuning.boxed_objects import check_boxes, is_round

    settings = detector_settings(options)
    given = [*options.models, *(each for each in options.names if "=" not in each)]
    if not given:
        raise InputError("give one network or several: model files (.onnx), or ball or soccer")
    models = {name: read_model(model_path(name)) for name in given}
    classes = {judged_class(each.manifest, name): each.manifest for name, each in models.items()}
    if len(classes) > 1:
        raise InputError(f"the networks find objects of different classes, {', '.join(classes)}: evaluate each alone")
    ((name, manifest),) = classes.items()
    if options.output is not None:
        paths = (each.path for each in models.values())
        check_evaluation_folder(options.output, (*paths, options.list, options.config))
    found = read_boxes(options.boxes, options.format, parse_names([each for each in options.names if "=" in each]))
    _complain(finding_lines(found.findings, False, f"vm-train check {options.boxes} --boxes --verbose lists all"))
    check_boxes(found, name, str(options.boxes))
    frames = _chosen(found.pictures, options.boxes, options.list, options.part)
    posed = sum(_has_pose(each) for each in frames)
    search = None if posed == len(frames) else Search.of(found.pictures, name, is_round(manifest))
    bare = next((each for each, model in models.items() if model.manifest.searched_class is None), None)
    if search is not None and bare is not None:
        raise InputError(f"{bare} has no close look, so it needs lens and pose of each frame")
    if search is None and settings.object_radius is None and (radius := _radius_of(frames)):
        settings = replace(settings, object_radius=radius)
        _complain([f"object radius {radius} m, from {OBJECT}"])
    bar = ProgressBar(len(frames) * len(models), "vm-evaluate", unit="frames")
    try:
        workers = options.workers or len(os.sched_getaffinity(0))
        trials = [Trial(each, model.path, settings, search) for each, model in models.items()]
        scores = [each.scores(frames, name, workers, bar.advance) for each in trials]
    finally:
        bar.clear()
    chosen = "" if options.list is None else f", in {options.list}"
    measured = LOOK_ALONE if search else WHOLE_DETECTOR
    about = [f"{len(frames)} of {len(found.pictures)} frames of {options.boxes}{chosen}; class {name}", measured]
    print("\n".join(box_lines(about, scores)))
    notes = _notes(options, models, posed, len(frames))
    _complain(notes)
    if options.output is not None:
        made = _about(options, models, search is None) | {"settings": asdict(settings), "notes": notes}
        content: dict[str, Any] = {"about": made, "class": name, "frames": [str(each.image) for each in frames]}
        content["networks"] = [{"network": each.name, "scores": each.as_dict()} for each in scores]
        write_box_evaluation(options.output, content, box_page(f"{options.boxes.name}: {name}", about + notes, scores))
        print(f"\n{options.output / 'report.html'}: written, with the worst errors; scores.json is beside it")
    return EXIT_OK


def _radius_of(frames: Sequence[BoxedPicture]) -> float | None:
    """The radius [m] in the object.toml beside all frames, if it is the same. Raises InputError."""
    shapes = [read_object_file(each) for each in {frame.image.parent for frame in frames}]
    radii = {None if each is None else each.radius for each in shapes}
    return radii.pop() if len(radii) == 1 else None


def _chosen(
    pictures: Sequence[BoxedPicture], folder: Path, chosen: Path | None, part: str | None
) -> list[BoxedPicture]:
    """The pictures in a part of a pictures.json, or all. Raises InputError for a picture that is not there."""
    if chosen is None:
        if part is not None:
            raise InputError(f"--part {part} needs the pictures.json of a fine-tuning: give it with --list")
        return list(pictures)
    part = part or "test"
    names = {each.image.relative_to(folder).as_posix(): each for each in pictures}
    wanted = getattr(read_split(chosen), part)
    for each in wanted:
        if each not in names:
            raise InputError(f"{chosen}: {folder} has no usable frame of this name: {unknown('frame', each, names)}")
    if not wanted:
        raise InputError(f"{chosen} names no frame of part {part}")
    return [names[each] for each in wanted]


def _has_pose(frame: BoxedPicture) -> bool:
    return frame.lens is not None and read_lens_file(frame.lens).orientation is not None


def _notes(options: argparse.Namespace, models: dict[str, ModelFile], posed: int, count: int) -> list[str]:
    """Remarks on frames with a pose among others, and on networks that may have learned from the frames."""
    notes = []
    if 0 < posed < count:
        notes.append(f"Only {posed} of the {count} frames have a lens file with a pose, so no frame used it.")
    folder = printable(options.boxes.resolve().name)
    for name, model in models.items():
        look = model.manifest.look
        learned = look is not None and look.provenance.get("fine_tuned_on") == folder
        if options.list is None and learned:
            notes.append(
                f"{name} learned from frames of a folder {folder}. The pictures.json of its fine-tuning, given with "
                "--list, leaves them out."
            )
    return notes


def _about(options: argparse.Namespace, models: dict[str, ModelFile], whole: bool) -> dict[str, Any]:
    """Networks, frames and what was measured, for scores.json."""
    return {
        "made_by": f"vm-evaluate {vm_embedded.__version__}",
        "networks": [{"file": name, "sha256": each.sha256} for name, each in models.items()],
        "measured": "whole detector" if whole else "close look",
        "boxes": str(options.boxes),
        "list": None if options.list is None else str(options.list),
        "part": None if options.list is None else options.part or "test",
    }


def _complain(lines: Sequence[str]) -> None:
    for each in lines:
        print(f"vm-evaluate: {each}", file=sys.stderr)
