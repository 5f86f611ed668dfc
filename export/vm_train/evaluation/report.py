"""An evaluation as one page of HTML that needs no other file and no network, and as lines for a terminal."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from vm_workstation.text_tables import aligned

Scores = Mapping[str, Any]
"""What goes to scores.json: that of evaluation_tables.as_json, and about: model, data, settings and notes."""

CAPTIONS = {
    "objects_curves": "Objects: precision, and false ones in a picture, over recall. The curves end where the "
    "detector's settings end: what it rejects has no confidence.",
    "objects_over_distance": "Objects by distance, at the detector's settings. Bins with fewer than 10 true objects "
    "are left out.",
    "distance_error": "Distance on the plane of objects that were found rightly at the lower IoU. Bins with "
    "fewer than 10 of them are left out.",
    "points_curves": "Points of each class against all others.",
    "points_over_distance": "Points by distance, at the threshold.",
    "confusion": "Which class the points of a class were taken for, by the highest probability.",
    "points_on_object": "Points on an object over its distance, as in the paper's figure ball_distance_graph. ",
}
"""Plots in the order of the page, and what stands under them."""

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; max-width: 1120px; margin: 2em auto; padding: 0 1em }
h1 { font-size: 1.5em; margin-bottom: 0.1em } h2 { font-size: 1.2em; margin: 2em 0 0.4em }
p.note { background: #fff6dd; border-left: 4px solid #e0b030; padding: 0.5em 0.8em }
.cards { display: flex; flex-wrap: wrap; gap: 0.7em; margin: 1em 0 }
.card { border: 1px solid #ddd; border-radius: 6px; padding: 0.5em 0.9em; min-width: 7.5em }
.card b { display: block; font-size: 1.45em } .card span { color: #666; font-size: 0.87em }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 0.92em }
th, td { padding: 0.2em 0.75em; text-align: right; border-bottom: 1px solid #e8e8e8 }
td { white-space: nowrap } .facts td { white-space: normal; overflow-wrap: anywhere }
th:first-child, td:first-child, .facts td { text-align: left } th { color: #555; font-weight: 600 }
figure { margin: 1.2em 0 } figure img { max-width: 100% } figcaption { color: #555; font-size: 0.9em }
.strip { display: flex; flex-wrap: wrap; gap: 0.8em } .strip figure { margin: 0 }
.true { color: #1f9a33 } .found { color: #c22bc2 }
"""


def page(scores: Scores, plots: Mapping[str, bytes], strips: Mapping[str, Sequence[tuple[bytes, str]]]) -> str:
    """The page. plots: SVG by name, as in CAPTIONS. strips: for a heading JPEG pictures with what stands under each."""
    about = scores["about"]
    parts = [
        f"<h1>{escape(about['model']['file'])}</h1>",
        f"<p>{escape(_subject(scores))}</p>",
        *(f'<p class="note">{escape(each)}</p>' for each in about["notes"]),
        _cards(scores),
    ]
    for name, by_overlap in scores["objects"].items():
        parts.append(f"<h2>Objects of class {escape(name)}</h2>{_table(*_object_table(by_overlap))}")
        parts.append(f"<p>{escape(_ignored(by_overlap))}</p>")
    parts += [_plot(name, plots, about) for name in ("objects_curves", "objects_over_distance", "distance_error")]
    for heading, pictures in strips.items():
        if pictures:
            parts.append(f"<h2>{escape(heading)}</h2>{_KEY}{_strip(pictures)}")
    parts.append(f"<h2>Points</h2>{_table(*_point_table(scores['points']))}")
    parts += [_plot(name, plots, about) for name in ("points_curves", "points_over_distance", "confusion")]
    if "points_on_object" in plots:
        parts.append("<h2>What the meshes see of an object</h2>" + _plot("points_on_object", plots, about))
    parts.append("<h2>How this was made</h2>" + _facts(scores))
    title = escape(f"vm-evaluate: {about['model']['file']}")
    head = f'<meta charset="utf-8"><title>{title}</title><style>{_STYLE}</style>'
    return f'<!doctype html>\n<html lang="en"><head>{head}</head><body>\n' + "\n".join(parts) + "\n</body></html>\n"


def lines(scores: Scores) -> str:
    """The summary for a terminal."""
    rows = [_subject(scores)]
    for name, by_overlap in scores["objects"].items():
        heading, body = _object_table(by_overlap)
        rows += ["", f"objects of class {name}", *aligned([heading, *body])]
    heading, body = _point_table(scores["points"])
    return "\n".join([*rows, "", "points", *aligned([heading, *body])])


_KEY = '<p>Outlines: <b class="true">true</b>, <b class="found">found</b>.</p>'


def _subject(scores: Scores) -> str:
    count, skipped = scores["pictures"], len(scores["skipped"])
    folders = ", ".join(scores["about"]["data"]["folders"])
    return f"{count} picture{'s' * (count != 1)} of {folders}" + (f", {skipped} skipped" if skipped else "")


def _ignored(by_overlap: Scores) -> str:
    return (
        f"{by_overlap['ignored']} objects are ignored, neither missed nor false if found: those that show less than "
        f"{100.0 * by_overlap['min_visible']:g} % of themselves or are smaller than {by_overlap['min_radius']:g} px "
        "in radius."
    )


def _cards(scores: Scores) -> str:
    cards = []
    for name, by_overlap in scores["objects"].items():
        overlaps = {key: table["all"] for key, table in by_overlap.items() if key.startswith("iou_")}
        for key, each in overlaps.items():
            cards.append((_number(each["average_precision"]), f"{name}: AP at IoU {key.removeprefix('iou_')}"))
        first = next(iter(overlaps.values()))
        errors = first["errors"]
        cards += [
            (_percent(first["recall"]), f"{name}: recall"),
            (_number(first["false_per_picture"], 2), f"{name}: false in a picture"),
            (_meters(errors["distance_median"]), f"{name}: distance error, median"),
            (_meters(errors["distance_p90"]), f"{name}: distance error, 90 %"),
        ]
    for name, bins in scores["points"].items():
        cards.append((_number(bins["all"]["average_precision"]), f"points of {name}: AP"))
    shown = (f'<div class="card"><b>{value}</b><span>{escape(what)}</span></div>' for value, what in cards)
    return f'<div class="cards">{"".join(shown)}</div>'


def _object_table(by_overlap: Scores) -> tuple[Sequence[str], list[Sequence[str]]]:
    """A row for each distance at which there is something, with recall and AP at every overlap."""
    overlaps = {key.removeprefix("iou_"): table for key, table in by_overlap.items() if key.startswith("iou_")}
    first = next(iter(overlaps.values()))
    heading = ["distance [m]", "true"]
    heading += [f"{what}@{overlap}" for what in ("recall", "precision", "AP") for overlap in overlaps]
    heading += ["false/picture", "error median", "error 90 %"]
    rows: list[Sequence[str]] = []
    for where, each in first.items():
        if not each["truths"] and not each["false"]:
            continue
        at = [table[where] for table in overlaps.values()]
        row = [where, str(each["truths"])]
        row += [_percent(table[what]) for what in ("recall", "precision") for table in at]
        row += [_number(table["average_precision"]) for table in at]
        errors = each["errors"]
        row += [_number(each["false_per_picture"]), _meters(errors["distance_median"]), _meters(errors["distance_p90"])]
        rows.append(row)
    return heading, rows


def _point_table(points: Scores) -> tuple[Sequence[str], list[Sequence[str]]]:
    names = ("precision", "recall", "f1", "mcc", "informedness", "markedness", "average_precision", "roc_auc")
    rows: list[Sequence[str]] = []
    for name, bins in points.items():
        rows.append([name, str(bins["all"]["points"]), *(_number(bins["all"][each]) for each in names)])
    return ["class", "points", "precision", "recall", "F1", "MCC", "informed.", "marked.", "AP", "ROC area"], rows


def _facts(scores: Scores) -> str:
    about = scores["about"]
    facts: dict[str, Any] = {"made by": about["made_by"]}
    for section in ("model", "data", "rules", "settings"):
        facts |= {f"{section}: {key.replace('_', ' ')}": value for key, value in about[section].items()}
    facts["pictures with sceneX.json"] = scores["pictures_with_scenes"]
    facts |= {f"skipped {path}": fault for path, fault in scores["skipped"].items()}
    rows = (f"<tr><td>{escape(key)}</td><td>{escape(_said(value))}</td></tr>" for key, value in facts.items())
    return f'<table class="facts">{"".join(rows)}</table>'


def _said(value: object) -> str:
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


def _strip(pictures: Iterable[tuple[bytes, str]]) -> str:
    shown = (
        f'<figure><img alt="" src="data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
        for jpeg, caption in pictures
    )
    return f'<div class="strip">{"".join(shown)}</div>'


def _table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(each)}</th>" for each in heading)
    body = "".join("<tr>" + "".join(f"<td>{escape(each)}</td>" for each in row) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"


def _number(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f} %"


def _meters(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f} m"
