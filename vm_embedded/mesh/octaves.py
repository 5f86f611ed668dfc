"""Model octaves: strips of rings, each with a constant number of columns, on which an ordinary convolution runs.

In the metric in which every object has the length 1, the number of points in a ring grows with the distance, so no flat
picture holds the whole mesh. But from some distance to its double, it grows only by two. So all rings of such an octave
get the same number of columns, and the octave is a small picture: a strip. In it an object is as wide as in the middle
of the octave, or up to the square root of two wider or narrower; the rings are those of the paper.

Around the rings of its octave, a strip has rows that only give context: the next rings inwards, and outwards rows at
equal angles, in the outermost strip to above the horizon. So a network sees what stands on the plane. What lies nearer
than the last octave is on one more strip, the foot: a square lattice of the plane around the point below the camera.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Indices, Mask, frozen
from ..errors import GeometryError
from ..geometry.shape import Shape
from .grids import STEPS, lattice_neighbors
from .mesh import STRIDE, Mesh, MeshModel, check_size, rays_from_polar
from .rings import inclinations

BLOCK, GAP = 8, 2
"""On a canvas, a strip begins at a multiple of BLOCK cells, and has GAP empty cells at its end."""

_ABOVE, _BELOW, _BESIDE = 3, 2, 8
"""Rows of context above and below the rings of an octave, at least, and columns of context where a strip ends behind
the camera."""

_RISE = 1.5
"""How far the outermost strip reaches upwards, at least, in units of the angle from its last ring to the horizon."""

_NEAREST = 6.0
"""Columns around the camera in the nearest ring of the octaves, in units of k: about two objects from the nadir."""


class Octaves(MeshModel):
    """Strips, the farthest first and the foot last. A column is to the right of the one before, a row above it.

    Points of context are `margin` in the mesh. Neighbors are in the same strip only.
    """

    neighbors = 8
    steps = STEPS[8]

    def _build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh:
        phi, columns, strips = _rings_of_strips(shape, height, intersections, max_distance)
        made = [_octave(phi, first, last, math.sqrt(columns[first] * columns[last])) for first, last in strips[:-1]]
        return _joined([*made, _foot(phi, strips[-1][1])], self.steps)


def strip_rays(shape: Shape, height: float, intersections: float, max_distance: float) -> Floats:
    """A ray (strips, 3) to the middle of each strip of this mesh, where points are as far apart as in its mean."""
    phi, _, strips = _rings_of_strips(shape, height, intersections, max_distance)
    cosines = np.array([np.cos(phi[first : last + 1]).mean() for first, last in strips])
    return rays_from_polar(np.arccos(cosines), np.zeros(len(cosines)))


def _rings_of_strips(
    shape: Shape, height: float, intersections: float, max_distance: float
) -> tuple[Floats, Floats, list[tuple[int, int]]]:
    """The inclinations (rings,) of the rings and their columns around the camera (rings,); for each strip, the foot
    last, its first and last ring. Raises GeometryError for too many points."""
    phi = inclinations(shape, height, intersections, max_distance)
    columns = 2.0 * np.pi * intersections / shape.theta(np.arange(len(phi)) / intersections, height)
    check_size(3.0 * float(columns.sum()))
    strips, last = [], len(phi) - 1
    while last > 0 and columns[last] > math.sqrt(2.0) * _NEAREST * intersections:
        first = int(np.searchsorted(columns, max(0.5 * columns[last], _NEAREST * intersections), side="right"))
        strips.append((first, last))
        last = first - 1
    return phi, columns, [*strips, (0, last)]


@dataclass(frozen=True, eq=False)
class _Strip:
    """Points of a strip: rays (n, 3), cells (n, 2) from 0, and which of them (n,) only give context."""

    rays: Floats
    cells: Indices
    margin: Mask


def _octave(phi: Floats, first: int, last: int, columns: float) -> _Strip:
    """The strip of the rings `first` to `last` with inclinations phi (rings,), and about so many columns around."""
    half = round(0.5 * columns)
    below = phi[max(first - _BELOW, 1) : first]
    above = _ABOVE + (-(len(below) + last + 1 - first + _ABOVE) - GAP) % BLOCK
    step = phi[last] - phi[last - 1]
    if last == len(phi) - 1:
        step = max(step, _RISE * (0.5 * np.pi - phi[last]) / above)
    rows = np.concatenate([below, phi[first : last + 1], phi[last] + step * np.arange(1, above + 1)])
    rows = rows[rows < np.pi]  # beyond the zenith, a row would show again what another one shows, upside down
    column = np.arange(-half - _BESIDE, half + _BESIDE)
    row = np.arange(len(rows))
    cells = np.stack(np.meshgrid(column + half + _BESIDE, row), axis=-1).reshape(-1, 2)
    # Columns are half a step from straight ahead, so that mirror images are alike.
    angle = -(column + 0.5) * (np.pi / half)
    rays = rays_from_polar(np.repeat(rows, len(column)), np.tile(angle, len(rows)))
    context = (row < len(below)) | (row > len(below) + last - first)
    beside = (column < -half) | (column >= half)
    return _Strip(rays, cells.astype(np.int32), (context[:, None] | beside[None]).reshape(-1))


def _foot(phi: Floats, last: int) -> _Strip:
    """The square lattice around the nadir, as far as the ring `last`, and context around it. Straight ahead is up."""
    step = math.tan(phi[1]) if len(phi) > 1 else 1.0
    reach = math.tan(phi[last]) + 0.5 * step if last > 0 else 0.5 * step
    half = math.ceil(reach / step - 0.5) + _BELOW
    side = np.arange(-half, half + 1)
    cells = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    right, ahead = step * cells.T
    rays = np.asfortranarray(np.stack([ahead, -right, np.full(len(cells), -1.0)], axis=1))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return _Strip(rays, (cells + half).astype(np.int32), np.hypot(right, ahead) >= reach)


def _joined(strips: Sequence[_Strip], steps: tuple[tuple[int, int], ...]) -> Mesh:
    """Strips as one mesh. Raises GeometryError for a strip with too many rows."""
    tallest = max(int(each.cells[:, 1].max()) + 1 for each in strips)
    if tallest >= STRIDE:
        raise GeometryError(
            f"an octave of the mesh would have {tallest} rows, and at most {STRIDE - 1} are allowed; choose fewer "
            "intersections, a larger object or a lower camera"
        )
    starts = np.cumsum([0, *(len(each.rays) for each in strips)])
    count = int(starts[-1])
    neighbors = np.full((count + 1, len(steps)), count, dtype=np.int32)
    for start, each in zip(starts, strips, strict=False):
        own = lattice_neighbors(each.cells, steps)[:-1]
        neighbors[start : start + len(own)] = np.where(own == len(own), count, own + start)
    cells = [each.cells + np.array([0, STRIDE * number], dtype=np.int32) for number, each in enumerate(strips)]
    return Mesh(
        frozen(np.asfortranarray(np.concatenate([each.rays for each in strips]))),
        frozen(neighbors),
        frozen(np.concatenate(cells)),
        frozen(np.concatenate([each.margin for each in strips])),
    )
