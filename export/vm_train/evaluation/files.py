"""The folder that vm-evaluate writes: scores.json, CSV files, plots, and report.html; the same run, the same files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from vm_embedded.errors import GeometryError, InputError
from vm_embedded.files import atomic_write
from vm_embedded.geometry.sphere import Sphere
from vm_embedded.network.manifest import Manifest
from vm_export.grid import Grid
from vm_workstation.plots import save_figure

from ..data.classes import Classes
from ..data.pictures import read_picture
from .evaluation import CameraPose, Evaluation
from .plots import plots
from .points_on_ball import Camera, points_over_distance
from .points_on_ball_plot import points_figure
from .report import page
from .tables import as_csv, as_json
from .worst_errors import WorstError
from .worst_pictures import drawn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TABLES = ("points", "point_curves", "confusion", "objects", "object_curves")
_PLOTS = (
    *("points_curves", "points_over_distance", "confusion", "points_on_object"),
    *("objects_curves", "objects_over_distance", "distance_error"),
)
_DISTANCES = np.linspace(0.0, 10.0, 51)  # [m]
_QUALITY = 85  # of small pictures


def write_evaluation(
    out: Path, evaluation: Evaluation, about: dict[str, Any], threshold: float, figure: Figure | None
) -> dict[str, Any]:
    """Write all files to a folder, which is made if it is not there, and return what scores.json holds.

    about: what was evaluated, on what and how. threshold: probability from which a point counts. figure: that of points
    on an object. What an earlier evaluation left there and this one does not have is removed. Raises InputError.
    """
    try:
        (out / "plots").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't make folder {out}: {error.strerror or error}") from error
    scores = {"about": about, **as_json(evaluation, threshold)}
    texts = {f"{name}.csv": text for name, text in as_csv(evaluation, threshold).items()}
    texts["scores.json"] = json.dumps(scores, indent=1, allow_nan=False) + "\n"
    figures = plots(evaluation, threshold) | ({} if figure is None else {"points_on_object": figure})
    for name, each in figures.items():
        for suffix in (".png", ".svg"):
            save_figure(each, out / "plots" / f"{name}{suffix}")
    images = {name: (out / "plots" / f"{name}.svg").read_bytes() for name in figures}
    texts["report.html"] = page(scores, images, _strips(evaluation))
    for file_name, text in texts.items():
        with atomic_write(out / file_name) as part:
            part.write_text(text, encoding="utf-8")
    for stale in {f"{name}.csv" for name in _TABLES}.difference(texts):
        (out / stale).unlink(missing_ok=True)
    for stale in set(_PLOTS).difference(figures):
        for suffix in (".png", ".svg"):
            (out / "plots" / f"{stale}{suffix}").unlink(missing_ok=True)
    return scores


def points_on_object(
    poses: Sequence[CameraPose], classes: Classes, manifest: Manifest, grid: Grid
) -> tuple[Figure | None, str]:
    """The paper's figure for a network's ball and the data's median camera, and which one that is.

    That camera is the one of the picture nearest to the medians of height and pitch; there is one picture or more. If
    it shows no such ball, there is no figure, but why.
    """
    if manifest.shape != "sphere":
        return None, f"The figure is of balls, and the network's objects are of shape {manifest.shape}."
    radius = manifest.object_radius
    values = np.array([(each.height, each.pitch) for each in poses])
    spread = np.maximum(values.std(axis=0), 1e-9)
    nearest = np.linalg.norm((values - np.median(values, axis=0)) / spread, axis=1).argmin()
    pose = poses[int(nearest)]
    picture = read_picture(pose.files, classes)
    orientation = picture.lens.orientation
    assert orientation is not None
    camera = Camera(orientation, picture.lens.lens, (picture.image.shape[1], picture.image.shape[0]))
    name = (
        f"Camera of {pose.files.image.name}, nearest to the median of all: {pose.height:.2f} m high, "
        f"{np.degrees(pose.pitch):.0f} degrees down; a ball of radius {radius:g} m."
    )
    try:
        curves = points_over_distance(camera, Sphere(radius), (3, 4, 5), _DISTANCES, grid.equal_at or None)
    except (InputError, GeometryError) as error:
        return None, f"{name} {error}"
    return points_figure(curves), name


def _strips(evaluation: Evaluation) -> Mapping[str, list[tuple[bytes, str]]]:
    odd = evaluation.worst
    return {
        "Objects that were missed, the largest": [
            (_jpeg(each), f"{_name(each)}: {each.class_name} of {each.rank:.1f} px") for each in odd.missed
        ],
        "What was taken for an object, the most confident": [
            (_jpeg(each), f"{_name(each)}: {each.class_name} {each.rank:.2f}") for each in odd.false
        ],
    }


def _name(error: WorstError) -> str:
    return error.files.image.name


def _jpeg(error: WorstError) -> bytes:
    return cv2.imencode(".jpg", drawn(error), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
