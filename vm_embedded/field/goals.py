"""Goals: pairs of posts at a goal's distance from each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .features import Upright

_WIDTHS = (1.2, 3.4)
"""Smallest and largest distance of a goal's posts [m]: from children's robots to those of adult size."""


def pair_posts(posts: Sequence[Upright]) -> tuple[tuple[int, int], ...]:
    """Indices of the left and right post of each goal, narrowest first; each post belongs to one goal at most."""
    pairs = []
    for number, one in enumerate(posts):
        for before in range(number):
            apart = float(np.hypot(*(one.position - posts[before].position)))
            if _WIDTHS[0] <= apart <= _WIDTHS[1]:
                pairs.append((apart, before, number))
    found: list[tuple[int, int]] = []
    taken: set[int] = set()
    for _, first, second in sorted(pairs):
        if not taken & {first, second}:
            taken |= {first, second}
            (x, y), (u, v) = posts[first].position, posts[second].position
            found.append((first, second) if u * y - v * x > 0.0 else (second, first))
    return tuple(found)
