"""The scores that people read first: tables of objects and of points, for a terminal and for the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vm_workstation.text_tables import aligned

Scores = Mapping[str, Any]
"""The content of scores.json: the scores of tables.as_json, and `about`: model, data, rules, settings and notes."""

Table = tuple[Sequence[str], list[Sequence[str]]]
"""A heading and rows, all as text."""


def lines(scores: Scores) -> str:
    """The summary for a terminal."""
    rows = [subject(scores)]
    for name, by_overlap in scores["objects"].items():
        heading, body = object_table(by_overlap)
        rows += ["", f"objects of class {name}", *aligned([heading, *body])]
    heading, body = point_table(scores["points"])
    return "\n".join([*rows, "", "points", *aligned([heading, *body])])


def subject(scores: Scores) -> str:
    """The number of pictures, their folders, and how many were skipped."""
    count, skipped = scores["pictures"], len(scores["skipped"])
    folders = ", ".join(scores["about"]["data"]["folders"])
    return f"{count} picture{'s' * (count != 1)} of {folders}" + (f", {skipped} skipped" if skipped else "")


def tables_by_overlap(by_overlap: Scores) -> dict[str, Scores]:
    """The scores of a class's objects by IoU, as "0.5"; each is a mapping of distance bins."""
    return {key.removeprefix("iou_"): table for key, table in by_overlap.items() if key.startswith("iou_")}


def object_table(by_overlap: Scores) -> Table:
    """A row for each distance bin with true or false objects; recall, precision and AP at every overlap."""
    overlaps = tables_by_overlap(by_overlap)
    first = next(iter(overlaps.values()))
    heading = ["distance [m]", "true"]
    heading += [f"{score}@{overlap}" for score in ("recall", "precision", "AP") for overlap in overlaps]
    heading += ["false/picture", "error median", "error 90 %"]
    rows: list[Sequence[str]] = []
    for distance, each in first.items():
        if not each["truths"] and not each["false"]:
            continue
        at = [table[distance] for table in overlaps.values()]
        row = [distance, str(each["truths"])]
        row += [as_percent(table[score]) for score in ("recall", "precision") for table in at]
        row += [as_number(table["average_precision"]) for table in at]
        errors = each["errors"]
        row += [as_number(each["false_per_picture"])]
        row += [as_meters(errors["distance_median"]), as_meters(errors["distance_p90"])]
        rows.append(row)
    return heading, rows


def point_table(points: Scores) -> Table:
    """A row for each class: the scores of its points over all distances."""
    names = ("precision", "recall", "f1", "mcc", "informedness", "markedness", "average_precision", "roc_auc")
    rows: list[Sequence[str]] = []
    for name, bins in points.items():
        rows.append([name, str(bins["all"]["points"]), *(as_number(bins["all"][each]) for each in names)])
    return ["class", "points", "precision", "recall", "F1", "MCC", "informed.", "marked.", "AP", "ROC area"], rows


def as_number(value: float | None, digits: int = 3) -> str:
    """A number with so many digits after the point, "-" for None."""
    return "-" if value is None else f"{value:.{digits}f}"


def as_percent(value: float | None) -> str:
    """A share as a percentage, "-" for None."""
    return "-" if value is None else f"{100.0 * value:.1f} %"


def as_meters(value: float | None) -> str:
    """A length [m] with its unit, "-" for None."""
    return "-" if value is None else f"{value:.3f} m"
