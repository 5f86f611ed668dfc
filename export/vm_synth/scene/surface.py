"""A table or a floor below the objects: its size, its place and its texture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats, Singles
from vm_embedded.config.entries import check_entries, share
from vm_workstation.ranges import log_uniform, range_of, uniform

from .textures import draw_texture


@dataclass(frozen=True)
class TableRanges:
    """Section [table]: the table or floor below objects that are not the ball."""

    length: tuple[float, float] = range_of(0.8, 2.5, "length of a table", "m", (0.1, 100.0))
    proportion: tuple[float, float] = range_of(0.45, 1.0, "width of a table as a share of its length", "", (0.05, 1.0))
    round: float = share(0.2, "share of tables that are round")
    texture_size: tuple[float, float] = range_of(0.3, 1.5, "side of a texture; it is repeated", "m", (0.01, 20.0))
    shine: tuple[float, float] = range_of(0.0, 0.25, "share of the light from above that a table mirrors", "", (0, 1))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class Surface:
    """A table or an endless floor at z = 0.

    length, width: sides [m], infinite for a floor. round: whether it is an ellipse with these axes. middle (2,) [m] and
    heading [rad]: in the world. texture: linear albedo (n, n, 3). texture_size: side of the texture [m]. shine: share
    of the light that it mirrors, without an image. seed: of slow changes of its color.
    """

    length: float
    width: float
    round: bool
    middle: tuple[float, float]
    heading: float
    texture: Singles
    texture_size: float
    shine: float
    seed: int

    @property
    def is_table(self) -> bool:
        """Whether it has an edge."""
        return math.isfinite(self.length)

    def local(self, points: Floats) -> Floats:
        """Points (..., 2) [m] of the plane in the surface's own frame, x along its length."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return np.asarray((points - np.array(self.middle)) @ np.array([[c, -s], [s, c]]))

    def depth_inside(self, local: Floats) -> Floats:
        """Distance (...) [m] of local points (..., 2) from the edge, about, positive inside; infinite for a floor."""
        if not self.is_table:
            return np.full(local.shape[:-1], np.inf)
        half = np.array([self.length, self.width]) / 2.0
        if self.round:
            return np.asarray((1.0 - np.linalg.norm(local / half, axis=-1)) * half.min())
        return np.asarray((half - np.abs(local)).min(axis=-1))

    def on_carpet(self, point: Floats, margin: float) -> bool:
        """Whether a point (2,) [m] is at least `margin` [m] inside the edge."""
        return bool(self.depth_inside(self.local(np.asarray(point, dtype=np.float64))) >= margin)


def draw_surface(
    random: np.random.Generator, ranges: TableRanges, table: bool, textures: Sequence[Singles], spot: Floats
) -> Surface:
    """Draw a table or a floor with a spot (2,) [m] on it.

    textures: pictures (h, w, 3) of linear albedo; without any, a texture is drawn.
    """
    length = log_uniform(random, ranges.length) if table else math.inf
    width = length * uniform(random, ranges.proportion)
    is_round, heading = bool(random.random() < ranges.round), random.uniform(-math.pi, math.pi)
    around, reach = random.uniform(-math.pi, math.pi), math.sqrt(random.random())
    middle = np.array(spot, dtype=np.float64)
    if table:
        c, s = math.cos(heading), math.sin(heading)
        # Within the ellipse in the table, and away from its edge.
        place = 0.4 * reach * np.array([length * math.cos(around), width * math.sin(around)])
        middle -= np.array([[c, -s], [s, c]]) @ place
    texture = textures[int(random.integers(len(textures)))] if textures else draw_texture(random)
    return Surface(
        length=length,
        width=width,
        round=is_round and table,
        middle=(float(middle[0]), float(middle[1])),
        heading=heading,
        texture=texture,
        texture_size=log_uniform(random, ranges.texture_size),
        shine=uniform(random, ranges.shine),
        seed=int(random.integers(1 << 31)),
    )
