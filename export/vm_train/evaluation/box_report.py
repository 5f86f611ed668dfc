"""The scores of several networks on frames with boxes, side by side: for a terminal, and as a page with their errors.

vm-evaluate --boxes writes both, and so does a fine-tuning about the network before and after it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

from vm_workstation.text_tables import aligned

from .box_scores import SIZES, BoxScores
from .html_page import html_page, html_strip, html_table
from .summary import Table, as_number, as_percent
from .worst_pictures import KEY, error_strips

_FEW = 30
"""With fewer boxes, one more or less changes the scores by several percent."""


def box_lines(about: Sequence[str], scores: Sequence[BoxScores]) -> list[str]:
    """The scores as lines of text. about: what was measured."""
    heading, rows = _table(scores)
    return [*about, "", *aligned([heading, *rows]), *_notes(scores)]


def box_page(title: str, about: Sequence[str], scores: Sequence[BoxScores]) -> str:
    """The scores and the worst errors of each network as HTML. about: what was measured."""
    parts = [f"<h1>{escape(title)}</h1>", *(f"<p>{escape(each)}</p>" for each in about)]
    if not scores[0].frames:
        return html_page(title, parts)
    parts += [html_table(*_table(scores)), *(f'<p class="note">{escape(each)}</p>' for each in _notes(scores))]
    for each in scores:
        for heading, pictures in error_strips(each.worst()).items():
            if pictures:
                parts.append(f"<h2>{escape(each.name)}: {escape(heading.lower())}</h2>{KEY}{html_strip(pictures)}")
    return html_page(title, parts)


def found_of(scores: BoxScores) -> str:
    """The scores over all sizes as text."""
    each = scores.as_dict()["all"]
    false = f"{each['false']} false object{'s' * (each['false'] != 1)}"
    return f"{each['found']} of {each['boxes']} boxes and {false}; AP50 {as_number(each['average_precision'])}"


def _table(scores: Sequence[BoxScores]) -> Table:
    """A row for each size and network, without sizes of which there is nothing."""
    return ["size [px]", "boxes", "network", "found", "recall", "false", "AP50"], list(_rows(scores))


def _rows(scores: Sequence[BoxScores]) -> Iterator[list[str]]:
    tables = [each.as_dict() for each in scores]
    for size in SIZES:
        if size != "all" and not any(table[size]["boxes"] or table[size]["false"] for table in tables):
            continue
        heads = [size, str(tables[0][size]["boxes"])]
        for network, table in zip(scores, tables, strict=True):
            each = table[size]
            values = as_percent(each["recall"], 0), str(each["false"]), as_number(each["average_precision"])
            yield [*heads, network.name, str(each["found"]), *values]
            heads = ["", ""]


def _notes(scores: Sequence[BoxScores]) -> list[str]:
    boxes = sum(len(frame.boxes) for frame in scores[0].frames)
    return [f"These are only {boxes} boxes: the scores depend much on chance."] if boxes < _FEW else []
