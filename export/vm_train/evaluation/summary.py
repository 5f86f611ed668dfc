"""The scores that people read first, as tables for a terminal and for the report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
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
        rows += ["", f"objects of class {name}", *aligned([heading, *body]), calibration(scores["calibration"][name])]
    for name, found in scores["proposals"].items():
        heading, body = proposal_table(found)
        rows += ["", f"proposals for class {name}: {proposal_counts(found)}", *aligned([heading, *body])]
    for name, (heading, body) in field_tables(scores["field"]).items():
        rows += ["", name, *aligned([heading, *body])]
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
    heading += ["false/picture", "error median", "error 90 %", "center median"]
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
        row += [as_radii(errors["center_median"])]
        rows.append(row)
    return heading, rows


def calibration(found: Scores) -> str:
    """A sentence on the calibration of a class's confidences."""
    error = as_number(found["expected_error"])
    return f"Expected calibration error (ECE): {error}, from {found['found']} found objects at IoU {found['iou']:g}"


def proposal_counts(found: Scores) -> str:
    """The number of proposals per picture."""
    return f"{as_number(found['mean_count'], 1)} per picture, at most {found['largest_count']}"


def proposal_table(found: Scores) -> Table:
    """A row for each distance bin with true objects: the share of them that a class's proposals are near."""
    reaches = [key for key in found["all"] if key.startswith("recall_")]
    rows: list[Sequence[str]] = [
        [name, str(each["truths"]), *(as_percent(each[key]) for key in reaches)]
        for name, each in found.items()
        if isinstance(each, Mapping) and (each["truths"] or name == "all")
    ]
    return ["distance [m]", "true", *(f"within {key.removeprefix('recall_')} r" for key in reaches)], rows


def field_tables(found: Scores) -> dict[str, Table]:
    """Tables of field features by heading, with a row for each distance bin that has any; none without features."""
    return {f"{name} of the field": _FIELD_TABLES[name](each) for name, each in found.items() if each["pictures"]}


def _upright_table(found: Scores) -> Table:
    within, limit = as_percent(found["tolerance"], 0), found["limit"]
    heading = ["distance [m]", "visible", f"within {within}", "error median", "median [m]"]
    heading += ["reported", "false", "false/picture", "people"]
    rows: list[Sequence[str]] = [
        [
            *(where, str(each["visible"]), as_percent(each["recall"])),
            *(as_percent(each["relative_error_median"]), as_meters(each["error_median"])),
            *(str(each["reported"]), str(each["false"]), as_number(each["false_per_picture"]), str(each["people"])),
        ]
        for where, each in _field_bins(found, f"0-{limit:g}", ("visible", "reported"))
    ]
    return heading, rows


def _line_table(found: Scores) -> Table:
    heading = ["distance [m]", "visible [m]", "found", "reported [m]", "wrong"]
    rows: list[Sequence[str]] = [
        [
            *(where, as_number(each["visible"], 1), as_percent(each["recall"])),
            *(as_number(each["reported"], 1), as_percent(each["wrong_share"])),
        ]
        for where, each in _field_bins(found, f"0-{found['limit']:g}", ("visible", "reported"))
    ]
    return heading, rows


def _border_table(found: Scores) -> Table:
    heading = ["distance [m]", "directions", "reported", "error median", "error 90 %"]
    rows: list[Sequence[str]] = [
        [
            *(where, str(each["directions"]), as_percent(each["reported_share"])),
            *(as_percent(each["error_median"]), as_percent(each["error_p90"])),
        ]
        for where, each in _field_bins(found, "", ("directions",))
    ]
    return heading, rows


_FIELD_TABLES = {
    "posts": _upright_table,
    "robots": _upright_table,
    "lines": _line_table,
    "border": _border_table,
}


def _field_bins(found: Scores, near: str, counts: Sequence[str]) -> Iterator[tuple[str, Scores]]:
    """The distance bins that have any of these counts, by name. near: name of the bin up to the limit."""
    for where, each in found.items():
        if isinstance(each, Mapping) and (where == "all" or any(each[key] for key in counts)):
            yield near if where == "near" else where, each


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


def as_percent(value: float | None, digits: int = 1) -> str:
    """A share as a percentage, "-" for None."""
    return "-" if value is None else f"{100.0 * value:.{digits}f} %"


def as_radii(value: float | None) -> str:
    """An angle in apparent radii, "-" for None."""
    return "-" if value is None else f"{value:.2f} r"


def as_meters(value: float | None) -> str:
    """A length [m] with its unit, "-" for None."""
    return "-" if value is None else f"{value:.3f} m"
