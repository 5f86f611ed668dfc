"""Lists and tables as lines of text, for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a table. The first column is flush left, the others are flush right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for first, *others in rows:
        cells = [first.ljust(widths[0]), *(each.rjust(n) for each, n in zip(others, widths[1:], strict=True))]
        lines.append("  ".join(cells).rstrip())
    return lines


def summary(values: Sequence[float]) -> dict[str, float]:
    """Least, 5 %, median, mean, 95 % and largest of some numbers."""
    low, few, median, many, high = (float(each) for each in np.percentile(values, [0, 5, 50, 95, 100]))
    return {"least": low, "5 %": few, "median": median, "mean": float(np.mean(values)), "95 %": many, "largest": high}


def shortened(lines: Sequence[str], most: int, rest: str) -> list[str]:
    """The first `most` lines, and if there are more, another one: "and 3 more" with `rest` as its end."""
    more = [f"and {len(lines) - most} more{rest}"] if len(lines) > most else []
    return [*lines[:most], *more]
