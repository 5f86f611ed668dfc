"""Accuracy of the networks of the package: `make score TEST=...`, on the sets of `make test-data`.

Writes benchmarks/shipped.json, from which benchmarks/shipped_report.py makes tables, plots and model cards, and the
sheet of the worst errors.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vm_embedded.borders.opencv_text import draw_text
from vm_embedded.cameras.image_files import read_image
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import GeometryError
from vm_embedded.files import write_file
from vm_embedded.network.bundled import DEFAULT, SHIPPED, model_path
from vm_embedded.network.model_file import read_model
from vm_train.data.classes import Classes
from vm_train.data.picture_files import PictureFiles
from vm_train.data.pictures import find_pictures, read_picture
from vm_train.evaluation.evaluation import Evaluation, Rules
from vm_train.evaluation.mask_colors import classes_with_colors, default_colors
from vm_train.evaluation.workers import Job, evaluate
from vm_train.evaluation.worst_errors import WorstError
from vm_train.evaluation.worst_pictures import draw_error
from vm_train.scores.calibration import Reliability
from vm_train.scores.object_scores import ObjectScores
from vm_train.scores.proposal_scores import ProposalScores

HERE = Path(__file__).parent
RESULTS = HERE / "shipped.json"
WORST = HERE.parent / "docs" / "worst.jpg"
NETWORKS = HERE.parent / "export" / "networks"
FRAMES_AN_HOUR = 30 * 3600
RANGES = {"0.5 to 6 m": range(1, 12), "6 to 10 m": range(12, 20), "1 to 6 m": range(2, 12)}
"""Bins of half a meter."""

SETS = ("field", "clutter")
"""Test sets: a field with robots and people, and a field full of things that resemble a ball."""

METERS = {f"{near} to {near + 1} m": range(2 * near, 2 * near + 2) for near in range(10)}
CANDIDATES = Settings(min_confidence=0.002)
"""Settings that accept nearly every proposal, for curves over all confidences."""

LIKELY = 0.01
"""Least confidence of the objects in a calibration error. Below are so many that they would hide the others."""


def evaluation(
    model: Path,
    pictures: Sequence[PictureFiles],
    settings: Settings,
    workers: int | None = None,
    as_robot: bool = False,
) -> Evaluation:
    """Evaluation of a network on pictures of vm-synth; each picture gets a mesh for its own ball.

    workers: processes, or None for one for each core. as_robot: run the detector as on a robot instead, with the mesh
    for its own ball.
    """
    job = _job(model, settings, as_robot)
    return evaluate(job, job.subject(), pictures, workers or len(os.sched_getaffinity(0)), lambda: None)


def _job(model: Path, settings: Settings, as_robot: bool = False) -> Job:
    return Job(model, settings, as_robot, classes_of(model), Rules("all" if as_robot else "scene"))


def classes_of(model: Path) -> Classes:
    """A network's classes with their colors in masks of vm-synth."""
    return classes_with_colors(read_model(model).manifest, default_colors(model, None), [])


def numbers(scores: ObjectScores, bins: range | None, overlap: float = 0.5) -> dict[str, Any]:
    """Average precision, recall, precision and errors of distance of the balls in some bins."""
    ranking = scores.ranking(overlap, bins)
    outcome, errors = ranking.at(), ranking.errors()
    found = {
        "balls": ranking.truths,
        "average_precision": ranking.precision_recall.average_precision,
        "recall": outcome.recall,
        "precision": outcome.precision,
        "false_per_picture": outcome.false_per_picture,
        "distance_error": errors.relative_median,
        "center_error": errors.center_median,
    }
    return {name: None if np.isnan(value) else round(float(value), 5) for name, value in found.items()}


def scores_of(model: Path, folder: Path) -> tuple[dict[str, Any], Evaluation]:
    """All figures of a network on a test set: with the default settings, and over all confidences."""
    used, ranked = (evaluation(model, find_pictures(folder), each) for each in (Settings(), CANDIDATES))
    ball, curve = used.objects["ball"], ranked.objects["ball"]
    found: dict[str, Any] = {
        "pictures": ball.pictures,
        "size": _size(folder),
        "points_average_precision": round(used.points.ranking("ball").precision_recall.average_precision, 5),
        "all": numbers(ball, None),
        "false_an_hour": round(FRAMES_AN_HOUR * ball.ranking(0.5).at().false_per_picture),
        "proposals": _proposals(used.proposals["ball"]),
        "calibration_error": {
            kind: round(calibration_error(scores), 5) for kind, scores in (("used", ball), ("ranked", curve))
        },
    }
    for kind, scores in (("used", ball), ("ranked", curve)):
        for overlap in (0.5, 0.75):
            found[f"{kind} {overlap}"] = {
                name: numbers(scores, bins, overlap) for name, bins in (RANGES | METERS).items()
            }
    found["curve"] = _curve(curve)
    return found, used


def calibration_error(scores: ObjectScores) -> float:
    """Expected calibration error of the objects that are likely."""
    ranking = scores.ranking(0.5)
    likely = ranking.confidence >= LIKELY
    return Reliability.of(ranking.confidence[likely], ranking.right[likely]).error


def _proposals(scores: ProposalScores) -> dict[str, Any]:
    """Numbers of proposals, and the share of the balls that have one."""
    return {"mean_count": round(float(np.mean(scores.counts)), 2), **scores.row()}


def wrong_sizes(model: Path, folder: Path) -> dict[str, dict[str, float]]:
    """How many balls the network accepts that are half or twice as large as it expects, by that factor."""
    job = _job(model, Settings())
    subject = job.subject()
    found: dict[str, dict[str, float]] = {}
    for factor in (0.5, 2.0):
        balls = accepted = 0
        for files in find_pictures(folder):
            scene = json.loads(files.image.with_name(f"scene{files.number}.json").read_text())
            ball = scene["ball"]
            if ball is None or ball["visible"] < 0.6 or ball["pixel_radius"] < 3.0:
                continue
            try:
                answer = subject.answer(read_picture(files, job.classes), scene["ball_radius"] / factor)
            except GeometryError:  # the camera is too low for such a large ball
                continue
            offsets = [np.hypot(*(each.center - np.array(ball["pixel"]))) for each in answer.found]
            balls += 1
            accepted += min(offsets, default=np.inf) < ball["pixel_radius"]
        found[f"{factor:g}"] = {"balls": balls, "accepted": int(accepted)}
    return found


def _size(folder: Path) -> list[int]:
    """Width and height of a set's pictures [px]."""
    height, width = read_image(min(folder.glob("image*.jpg"))).shape[:2]
    return [width, height]


def _curve(scores: ObjectScores) -> list[list[float]]:
    """Confidence, precision and recall, at two hundred points or fewer."""
    curve = scores.ranking(0.5).precision_recall
    chosen = np.unique(np.linspace(0, len(curve.recall) - 1, 200).astype(int)) if len(curve.recall) else []
    return [[round(float(each[at]), 4) for each in (curve.thresholds, curve.precision, curve.recall)] for at in chosen]


def sheet(result: Evaluation, count: int = 20) -> tuple[np.ndarray, list[str]]:
    """The worst errors of an evaluation, half of them missed and half of them false, as pictures with a description."""
    missed, false = result.worst.missed[: count // 2], result.worst.false[: count // 2]
    cells, words = [], []
    for number, each in enumerate((*missed, *false), 1):
        cells.append(_numbered(draw_error(each), number))
        words.append(_said(each, missed=number <= len(missed)))
    width = max(cell.shape[1] for cell in cells)
    cells = [cv2.copyMakeBorder(cell, 2, 2, 2, width - cell.shape[1] + 2, cv2.BORDER_CONSTANT) for cell in cells]
    cells += [np.zeros_like(cells[0])] * (-len(cells) % 4)
    return np.vstack([np.hstack(cells[start : start + 4]) for start in range(0, len(cells), 4)]), words


def _numbered(cell: np.ndarray, number: int) -> np.ndarray:
    for shade, thickness in ((0, 4), (255, 2)):
        draw_text(cell, str(number), (6, 24), 0.8, (shade,) * 3, thickness)
    return cell


def _said(error: WorstError, missed: bool) -> str:
    name = error.image.stem
    return f"{name}: missed, {error.radius:.0f} px" if missed else f"{name}: false, confidence {error.rank:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("test", type=Path, help="folder of test sets")
    parser.add_argument("--network", choices=SHIPPED, help="score only this network; the results keep the others")
    options = parser.parse_args()
    found: dict[str, Any] = {"networks": {}, "grid": {}}
    if options.network:
        found = json.loads(RESULTS.read_text())
    for name in (options.network,) if options.network else SHIPPED:
        found["networks"][name] = {}
        for each in SETS:
            scores, used = scores_of(model_path(name), options.test / each)
            scores["wrong_sizes"] = wrong_sizes(model_path(name), options.test / each)
            found["networks"][name][each] = scores
            print(name, each, json.dumps(scores["ranked 0.5"]), flush=True)
            if name == DEFAULT and each == "field":
                picture, found["worst"] = sheet(used)
                write_file(WORST, cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes())
    for folder in sorted((options.test / "grid").glob("*")) if options.network in (None, DEFAULT) else ():
        used = evaluation(model_path(DEFAULT), find_pictures(folder), Settings())
        found["grid"][folder.name] = numbers(used.objects["ball"], None)
        print(folder.name, found["grid"][folder.name], flush=True)
    RESULTS.write_text(json.dumps(found) + "\n")


if __name__ == "__main__":
    main()
