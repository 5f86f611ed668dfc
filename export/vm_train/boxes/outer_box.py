"""Outer boxes: of polygons and of oriented boxes."""

from __future__ import annotations

import math
from collections.abc import Iterable

from vm_embedded.output.box_files import Edges


def outer_box(corners: Iterable[tuple[float, float]]) -> Edges:
    """The smallest upright box around corners (x, y), of which there is at least one."""
    xs, ys = zip(*corners, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def outer_box_of_turned(edges: Edges, angle: float) -> Edges:
    """The smallest upright box around a box that is turned around its middle. angle: [rad], from x to y."""
    if not angle:
        return edges
    left, top, right, bottom = edges
    x, y, width, height = (left + right) / 2.0, (top + bottom) / 2.0, right - left, bottom - top
    sine, cosine = abs(math.sin(angle)), abs(math.cos(angle))
    reach_x, reach_y = (width * cosine + height * sine) / 2.0, (width * sine + height * cosine) / 2.0
    return x - reach_x, y - reach_y, x + reach_x, y + reach_y
