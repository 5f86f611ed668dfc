"""Long lists of lines for a terminal."""

from __future__ import annotations

from collections.abc import Sequence


def shortened(lines: Sequence[str], most: int, rest: str) -> list[str]:
    """The first `most` lines, and if there are more, another one: "and 3 more" with `rest` as its end."""
    more = [f"and {len(lines) - most} more{rest}"] if len(lines) > most else []
    return [*lines[:most], *more]
