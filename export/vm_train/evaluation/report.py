"""The report of an evaluation: one HTML page that needs no other file and no network."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from .html_page import html_page, html_strip, html_table
from .summary import (
    Scores,
    as_meters,
    as_number,
    as_percent,
    as_radii,
    calibration,
    field_tables,
    object_table,
    point_table,
    proposal_counts,
    proposal_table,
    subject,
    tables_by_overlap,
)
from .worst_pictures import KEY

CAPTIONS = {
    "objects_curves": "Objects: precision and false objects per picture, over recall. The curves end at the detector's "
    "settings, because objects that it rejects do not count.",
    "objects_over_distance": "Objects by distance, at the detector's settings. The plots leave out bins with fewer "
    "than 10 true objects.",
    "distance_error": "Distance errors on the plane, of the objects found at the lower IoU. The plots leave out bins "
    "with fewer than 10 of them.",
    "reliability": "Calibration: share of the found objects that are right at the lower IoU, in 15 bins of confidence, "
    "with 90 % intervals. On the diagonal, nine of ten objects found with a confidence of 0.9 are right. The expected "
    "calibration error (ECE) is the mean distance from the diagonal, weighted by the number of objects in each bin.",
    "points_curves": "Points of each class against all other points.",
    "points_over_distance": "Points by distance, at the threshold.",
    "confusion": "The most probable class of the points of each true class.",
    "points_on_object": "Points on an object over its distance, as in the paper's figure fig:ball_distance_graph. ",
}
"""Captions of the plots, in the order of the page."""


_OBJECT_PLOTS = ("objects_curves", "objects_over_distance", "distance_error", "reliability")

_CENTER = "Center: angle between the rays to the true and the found center, over the object's apparent radius (r)."


def page(scores: Scores, plots: Mapping[str, bytes], strips: Mapping[str, Sequence[tuple[bytes, str]]]) -> str:
    """The HTML text. plots: SVG by name, as in CAPTIONS. strips: by heading, JPEG pictures with their captions."""
    about = scores["about"]
    parts = [
        f"<h1>{escape(about['model']['file'])}</h1>",
        f"<p>{escape(subject(scores))}</p>",
        *(f'<p class="note">{escape(each)}</p>' for each in about["notes"]),
        _cards(scores),
    ]
    for name, by_overlap in scores["objects"].items():
        parts.append(f"<h2>Objects of class {escape(name)}</h2>{html_table(*object_table(by_overlap))}")
        parts.append(f"<p>{_CENTER} {escape(_ignored(by_overlap))}</p>")
        parts.append(f"<p>{escape(calibration(scores['calibration'][name]))}.</p>")
    parts += [_plot(name, plots, about) for name in _OBJECT_PLOTS]
    for name, found in scores["proposals"].items():
        parts.append(f"<h2>Proposals for class {escape(name)}</h2><p>{escape(proposal_counts(found))}.</p>")
        parts.append(html_table(*proposal_table(found)))
    for heading, pictures in strips.items():
        if pictures:
            parts.append(f"<h2>{escape(heading)}</h2>{KEY}{html_strip(pictures)}")
    for name, each in field_tables(scores["field"]).items():
        parts.append(f"<h2>{escape(name[0].upper() + name[1:])}</h2>{html_table(*each)}")
    parts.append(f"<h2>Points</h2>{html_table(*point_table(scores['points']))}")
    parts += [_plot(name, plots, about) for name in ("points_curves", "points_over_distance", "confusion")]
    if "points_on_object" in plots:
        parts.append("<h2>Mesh points on an object</h2>" + _plot("points_on_object", plots, about))
    parts.append("<h2>Model, data and settings</h2>" + _facts(scores))
    return html_page(f"vm-evaluate: {about['model']['file']}", parts)


def _ignored(by_overlap: Scores) -> str:
    visible, radius = 100.0 * by_overlap["min_visible"], by_overlap["min_radius"]
    return (
        f"Ignored objects: {by_overlap['ignored']}. Less than {visible:g} % of them is visible, or their radius is "
        f"below {radius:g} px. They count neither as missed nor, if found, as false."
    )


def _cards(scores: Scores) -> str:
    cards = []
    for name, by_overlap in scores["objects"].items():
        overlaps = {overlap: table["all"] for overlap, table in tables_by_overlap(by_overlap).items()}
        for overlap, each in overlaps.items():
            cards.append((as_number(each["average_precision"]), f"{name}: AP at IoU {overlap}"))
        first = next(iter(overlaps.values()))
        errors = first["errors"]
        cards += [
            (as_percent(first["recall"]), f"{name}: recall"),
            (as_number(first["false_per_picture"], 2), f"{name}: false per picture"),
            (as_meters(errors["distance_median"]), f"{name}: distance error, median"),
            (as_meters(errors["distance_p90"]), f"{name}: distance error, 90 %"),
            (as_radii(errors["center_median"]), f"{name}: center error, median"),
            (as_number(scores["calibration"][name]["expected_error"]), f"{name}: calibration error (ECE)"),
        ]
    for name, found in scores["proposals"].items():
        cards.append((as_percent(found["all"]["recall_0.5"]), f"{name}: proposed within 0.5 radii"))
        cards.append((as_number(found["mean_count"], 1), f"{name}: proposals per picture"))
    for name, bins in scores["points"].items():
        cards.append((as_number(bins["all"]["average_precision"]), f"points of {name}: AP"))
    shown = (f'<div class="card"><b>{value}</b><span>{escape(label)}</span></div>' for value, label in cards)
    return f'<div class="cards">{"".join(shown)}</div>'


def _facts(scores: Scores) -> str:
    about = scores["about"]
    facts: dict[str, Any] = {"made by": about["made_by"]}
    for section in ("model", "data", "rules", "settings"):
        facts |= {f"{section}: {key.replace('_', ' ')}": value for key, value in about[section].items()}
    facts["pictures with sceneX.json"] = scores["pictures_with_scenes"]
    facts |= {f"skipped {path}": fault for path, fault in scores["skipped"].items()}
    rows = (f"<tr><td>{escape(key)}</td><td>{escape(_as_text(value))}</td></tr>" for key, value in facts.items())
    return f'<table class="facts">{"".join(rows)}</table>'


def _as_text(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(map(str, value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "-" if value is None else str(value)


def _plot(name: str, plots: Mapping[str, bytes], about: Scores) -> str:
    if name not in plots:
        return ""
    caption = CAPTIONS[name] + (about["camera"] if name == "points_on_object" else "")
    source = f"data:image/svg+xml;base64,{base64.b64encode(plots[name]).decode()}"
    return f'<figure><img alt="{name}" src="{source}"><figcaption>{escape(caption)}</figcaption></figure>'
