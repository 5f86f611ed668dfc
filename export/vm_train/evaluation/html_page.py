"""Parts of an HTML page that needs no other file and no network."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; max-width: 1180px; margin: 2em auto; padding: 0 1em }
h1 { font-size: 1.5em; margin-bottom: 0.1em } h2 { font-size: 1.2em; margin: 2em 0 0.4em }
p.note { background: #fff6dd; border-left: 4px solid #e0b030; padding: 0.5em 0.8em }
.cards { display: flex; flex-wrap: wrap; gap: 0.7em; margin: 1em 0 }
.card { border: 1px solid #ddd; border-radius: 6px; padding: 0.5em 0.9em; min-width: 7.5em }
.card b { display: block; font-size: 1.45em } .card span { color: #666; font-size: 0.87em }
table { display: block; max-width: 100%; overflow-x: auto; border-collapse: collapse }
table { font-variant-numeric: tabular-nums; font-size: 0.92em }
th, td { padding: 0.2em 0.75em; text-align: right; border-bottom: 1px solid #e8e8e8 }
td { white-space: nowrap } .facts td { white-space: normal; overflow-wrap: anywhere }
th:first-child, td:first-child, .facts td { text-align: left } th { color: #555; font-weight: 600 }
figure { margin: 1.2em 0 } figure img { max-width: 100% } figcaption { color: #555; font-size: 0.9em }
.strip { display: flex; flex-wrap: wrap; gap: 0.8em; align-items: flex-start } .strip figure { margin: 0 }
.true { color: #1f9a33 } .found { color: #c22bc2 }
"""


def html_page(title: str, parts: Sequence[str]) -> str:
    """The HTML text of a page with these parts, which are HTML already."""
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><style>{_STYLE}</style>'
    return f'<!doctype html>\n<html lang="en"><head>{head}</head><body>\n' + "\n".join(parts) + "\n</body></html>\n"


def html_strip(pictures: Iterable[tuple[bytes, str]]) -> str:
    """Pictures side by side: JPEG files, each with its caption."""
    shown = (
        f'<figure><img alt="" src="data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
        for jpeg, caption in pictures
    )
    return f'<div class="strip">{"".join(shown)}</div>'


def html_table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table with a heading (c,) and rows (r, c)."""
    head = "".join(f"<th>{escape(each)}</th>" for each in heading)
    body = "".join("<tr>" + "".join(f"<td>{escape(each)}</td>" for each in row) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"
