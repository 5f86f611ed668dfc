"""The soccer field of a scene file: its lines and the edge of its carpet, as vm-synth paints them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats
from vm_synth.scene.field import line_segments

from ..scores.line_shapes import Lines


@dataclass(frozen=True)
class FieldModel:
    """A field: its size [m], its center (2,) [m] and heading [rad] in the frame of the picture's orientation.

    border [m]: width of the carpet outside of the outer lines; infinite without an edge. Raises ValueError for sizes
    that are not positive and for numbers that are not finite.
    """

    length: float
    width: float
    border: float
    middle: tuple[float, float]
    heading: float

    def __post_init__(self) -> None:
        sizes = all(0.0 < each < math.inf for each in (self.length, self.width)) and self.border >= 0.0
        if not (sizes and all(math.isfinite(each) for each in (*self.middle, self.heading))):
            raise ValueError("a number of its field is out of range")

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> FieldModel:
        """From the entry `field` of a scene file. Raises KeyError, TypeError or ValueError if it is damaged."""
        x, y = map(float, table["middle"])
        border = table["border"]
        return cls(
            length=float(table["length"]),
            width=float(table["width"]),
            border=math.inf if border is None else float(border),
            middle=(x, y),
            heading=float(table["heading"]),
        )

    def placed(self, points: Floats) -> Floats:
        """Points (..., 2) of the field's frame, with x along its length, in the frame of the picture's orientation."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return np.asarray(points @ np.array([[c, s], [-s, c]]) + np.array(self.middle))

    def lines(self) -> Lines:
        """The middle lines: outline, halfway line, center circle, goal and penalty areas. Marks are not lines."""
        segments = line_segments(self.length, self.width)
        return Lines(self.placed(segments), [(np.array(self.middle), self.length / 12.0)])

    def carpet(self) -> Floats | None:
        """Corners (5, 2) [m] of the carpet, the first one twice; None without an edge."""
        if math.isinf(self.border):
            return None
        x, y = self.length / 2.0 + self.border, self.width / 2.0 + self.border
        return self.placed(np.array([(x, y), (-x, y), (-x, -y), (x, -y), (x, y)]))
