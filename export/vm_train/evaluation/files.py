"""The output folder of vm-evaluate: scores.json, CSV files, plots and report.html. Equal runs give equal files."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vm_embedded.borders.text import to_json
from vm_embedded.errors import InputError
from vm_embedded.files import check_not_input, exists, read_regular, write_file
from vm_embedded.output.result_files import make_folder
from vm_workstation.plots import save_figure

from .evaluation import Evaluation
from .object_plots import distance_errors, object_curves, objects_over_distance, reliability
from .point_plots import confusion, point_curves, points_over_distance
from .report import page
from .tables import as_csv, as_json
from .worst_pictures import error_strips

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TABLES = ("points", "point_curves", "confusion", "objects", "object_curves", "calibration", "proposals", "field")
_PLOTS = (
    *("points_curves", "points_over_distance", "confusion", "points_on_object"),
    *("objects_curves", "objects_over_distance", "distance_error", "reliability"),
)
_SCORES, _REPORT = "scores.json", "report.html"


def check_evaluation_folder(out: Path, inputs: Iterable[Path | None]) -> None:
    """Raise InputError unless an evaluation may be written to a folder.

    It may be a new one, and may hold an earlier evaluation, which is replaced. A file with one of these names that no
    evaluation wrote stays, and so does an input.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"can't write to {out}: it is not a folder")
    given = list(inputs)
    names = (_SCORES, _REPORT, *(f"{each}.csv" for each in _TABLES), *(f"plots/{each}.svg" for each in _PLOTS))
    for name in names:
        check_not_input(out / name, given)
    present = [name for name in names if exists(out / name)]
    if present and not _is_evaluation(out):
        raise InputError(f"{out} holds {present[0]}, which no evaluation wrote: give another folder")


def _is_evaluation(out: Path) -> bool:
    """Whether a folder has the scores.json of an evaluation, which is the first file that it writes."""
    try:
        content = json.loads(read_regular(out / _SCORES))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(content, dict) and isinstance(content.get("about"), dict)


def write_evaluation(
    out: Path, evaluation: Evaluation, about: dict[str, Any], threshold: float, points_on_object: Figure | None
) -> dict[str, Any]:
    """Write all files to a folder, which is created if missing, and return the content of scores.json.

    about: model, data, rules, settings and notes. threshold: probability from which a point counts. points_on_object:
    a figure to add to the plots. Removes files of an earlier evaluation that this one does not have. Raises InputError
    if a file can't be written.
    """
    try:
        (out / "plots").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't create folder {out}: {error.strerror or error}") from error
    scores = {"about": about, **as_json(evaluation, threshold)}
    write_file(out / _SCORES, to_json(scores, indent=1, allow_nan=False) + "\n")
    texts = {f"{name}.csv": text for name, text in as_csv(evaluation, threshold).items()}
    figures = _figures(evaluation, threshold)
    if points_on_object is not None:
        figures["points_on_object"] = points_on_object
    for name, each in figures.items():
        save_figure(each, out / "plots" / f"{name}.svg")
    images = {name: (out / "plots" / f"{name}.svg").read_bytes() for name in figures}
    texts[_REPORT] = page(scores, images, error_strips(evaluation.worst))
    for file_name, text in texts.items():
        write_file(out / file_name, text)
    _remove_stale(out, texts, figures)
    return scores


def write_box_evaluation(out: Path, scores: dict[str, Any], page: str) -> None:
    """Write scores.json and report.html of frames with boxes, as `write_evaluation` does. scores: with `about`."""
    make_folder(out)
    write_file(out / _SCORES, to_json(scores, indent=1, allow_nan=False) + "\n")
    write_file(out / _REPORT, page)
    _remove_stale(out, (), ())


def _remove_stale(out: Path, tables: Collection[str], plots: Collection[str]) -> None:
    """Remove the tables and plots of an earlier evaluation that this one does not have."""
    for stale in {f"{name}.csv" for name in _TABLES}.difference(tables):
        (out / stale).unlink(missing_ok=True)
    for stale in set(_PLOTS).difference(plots):
        (out / "plots" / f"{stale}.svg").unlink(missing_ok=True)


def _figures(evaluation: Evaluation, threshold: float) -> dict[str, Figure]:
    """All plots by name. Raises InputError without matplotlib."""
    points, objects = evaluation.points, evaluation.objects
    figures = {
        "points_curves": point_curves(points),
        "points_over_distance": points_over_distance(points, threshold),
        "confusion": confusion(points),
    }
    if objects:
        figures["objects_curves"] = object_curves(objects)
        figures["objects_over_distance"] = objects_over_distance(objects)
        figures["distance_error"] = distance_errors(objects)
        figures["reliability"] = reliability(objects)
    return figures
