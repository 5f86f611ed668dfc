"""The scores of an evaluation for other programs: as JSON and as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from typing import Any

from ..scores.distance_bins import DISTANCE_EDGES, named_bins
from ..scores.field_scores import FieldScores
from .evaluation import Evaluation


def as_json(evaluation: Evaluation, threshold: float) -> dict[str, Any]:
    """All scores, over all distances and in each bin; None for a score without a value.

    threshold: probability from which a point counts.
    """
    points = evaluation.points
    bins = named_bins(points.distance_edges)
    return {
        "pictures": len(evaluation.poses),
        "pictures_with_scenes": len(evaluation.radii),
        "skipped": evaluation.faults,
        "points": {
            name: {where: points.ranking(name, number).as_dict(threshold) for where, number in bins.items()}
            for name in points.classes
        },
        "confusion": {"classes": list(points.classes)}
        | {where: points.confusion(number).tolist() for where, number in bins.items()},
        "objects": {
            name: {"ignored": scores.ignored, "min_visible": scores.min_visible, "min_radius": scores.min_radius}
            | {
                f"iou_{overlap:g}": {where: scores.ranking(overlap, number).as_dict() for where, number in bins.items()}
                for overlap in scores.overlaps
            }
            for name, scores in evaluation.objects.items()
        },
        "calibration": {
            name: {"iou": scores.overlaps[0], **scores.ranking(scores.overlaps[0]).reliability.as_dict()}
            for name, scores in evaluation.objects.items()
        },
        "proposals": {name: scores.as_dict() for name, scores in evaluation.proposals.items()},
        "field": {} if evaluation.features is None else evaluation.features.as_dict(),
    }


def as_csv(evaluation: Evaluation, threshold: float) -> dict[str, str]:
    """The same scores and the curves as CSV texts, by file name. A score without a value is empty."""
    found = {
        "points": _text(_point_rows(evaluation, threshold)),
        "point_curves": _text(_point_curves(evaluation)),
        "confusion": _text(_confusion_rows(evaluation)),
    }
    if evaluation.objects:
        found |= {"objects": _text(_object_rows(evaluation)), "object_curves": _text(_object_curves(evaluation))}
        found["calibration"] = _text(_calibration_rows(evaluation))
    if evaluation.proposals:
        found["proposals"] = _text(_proposal_rows(evaluation))
    if evaluation.features is not None:
        found["field"] = _text(_field_rows(evaluation.features))
    return found


def _point_rows(evaluation: Evaluation, threshold: float) -> Iterable[dict[str, object]]:
    for name in evaluation.points.classes:
        for where, number in named_bins(evaluation.points.distance_edges).items():
            yield {"class": name, "distance": where, **evaluation.points.ranking(name, number).as_dict(threshold)}


def _point_curves(evaluation: Evaluation) -> Iterable[dict[str, object]]:
    for name in evaluation.points.classes:
        ranking = evaluation.points.ranking(name)
        curve, false = ranking.precision_recall, ranking.roc.false_positive_rate[1:]
        for threshold, *rates in zip(curve.thresholds, curve.precision, curve.recall, false, strict=True):
            values = dict(zip(("precision", "recall", "false_positive_rate"), map(_short, rates), strict=True))
            yield {"class": name, "threshold": _short(threshold), **values}


def _confusion_rows(evaluation: Evaluation) -> Iterable[dict[str, object]]:
    points = evaluation.points
    for where, number in named_bins(points.distance_edges).items():
        for name, row in zip(points.classes, points.confusion(number).tolist(), strict=True):
            taken = {f"taken for {each}": count for each, count in zip(points.classes, row, strict=True)}
            yield {"distance": where, "class": name, **taken}


def _object_rows(evaluation: Evaluation) -> Iterable[dict[str, object]]:
    for name, scores in evaluation.objects.items():
        for overlap in scores.overlaps:
            for where, number in named_bins(scores.distance_edges).items():
                values = scores.ranking(overlap, number).as_dict()
                errors = {f"error_{key}": each for key, each in values.pop("errors").items()}
                yield {"class": name, "iou": overlap, "distance": where, **values, **errors}


def _object_curves(evaluation: Evaluation) -> Iterable[dict[str, object]]:
    for name, scores in evaluation.objects.items():
        for overlap in scores.overlaps:
            curve = scores.ranking(overlap).precision_recall
            for row in zip(curve.thresholds, curve.precision, curve.recall, strict=True):
                values = dict(zip(("confidence", "precision", "recall"), map(_short, row), strict=True))
                yield {"class": name, "iou": overlap, **values}


def _calibration_rows(evaluation: Evaluation) -> Iterable[dict[str, object]]:
    for name, scores in evaluation.objects.items():
        overlap = scores.overlaps[0]
        for row in scores.ranking(overlap).reliability.rows():
            yield {"class": name, "iou": overlap, **row}


def _proposal_rows(evaluation: Evaluation) -> Iterable[dict[str, object]]:
    for name, scores in evaluation.proposals.items():
        for where, number in named_bins(DISTANCE_EDGES).items():
            yield {"class": name, "distance": where, **scores.row(number)}


def _field_rows(features: FieldScores) -> Iterable[dict[str, object]]:
    rows = []
    for name, scores in features.as_dict().items():
        for where, row in scores.items():
            if isinstance(row, dict):
                rows.append({"feature": name, "distance": where, **row})
    columns = {key: "" for row in rows for key in row}  # not every feature has all of them
    return [columns | row for row in rows]


def _short(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.7g}"


def _text(rows: Iterable[dict[str, object]]) -> str:
    """Rows as CSV text, with a heading."""
    every = list(rows)
    text = io.StringIO()
    writer = csv.DictWriter(text, list(every[0]) if every else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(every)
    return text.getvalue()
