"""Middle lines on the plane: straight pieces and circles, their samples, and distances from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats

STEP = 0.02
"""Distance between two samples of a line [m]."""


@dataclass(frozen=True, eq=False)
class Lines:
    """Middle lines. segments (k, 2, 2) [m]: the ends of the straight ones. circles: center (2,) and radius [m]."""

    segments: Floats
    circles: Sequence[tuple[Floats, float]] = ()

    def samples(self) -> Floats:
        """Points (n, 2) in the middle of pieces of about STEP, each for an equal length."""
        parts = [np.zeros((0, 2))]
        for start, end in self.segments:
            share = _middles(math.hypot(*(end - start)))
            parts.append(start + share[:, None] * (end - start))
        for center, radius in self.circles:
            angle = 2.0 * math.pi * _middles(2.0 * math.pi * radius)
            parts.append(center + radius * np.column_stack([np.cos(angle), np.sin(angle)]))
        return np.concatenate(parts)

    def distances(self, points: Floats) -> Floats:
        """Distances (n,) [m] of points (n, 2) from the nearest line; infinite without lines."""
        nearest = np.full(len(points), np.inf)
        for start, end in self.segments:
            along = end - start
            share = np.clip((points - start) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
            np.minimum(nearest, np.hypot(*(points - start - share[:, None] * along).T), out=nearest)
        for center, radius in self.circles:
            np.minimum(nearest, np.abs(np.hypot(*(points - center).T) - radius), out=nearest)
        return nearest


def _middles(length: float) -> Floats:
    """Places (m,) of the samples of a line of this length [m], as shares of it."""
    count = round(length / STEP)
    return (np.arange(count) + 0.5) / max(count, 1)
