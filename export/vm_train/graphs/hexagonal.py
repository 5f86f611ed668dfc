"""The paper's baseline: a regular hexagonal mesh in the picture, which ignores the observation plane.

With as many points as a Visual Mesh, it costs a network the same ("equal computational cost due to selecting the same
number of pixels", section "Network Architecture"). But a far object has fewer points than a near one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Indices, Mask, frozen
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Lens, Size

ROW = math.sqrt(3.0) / 2.0
"""Distance between rows, in spacings of the points within a row."""

_STEPS = ((0, 2), (-1, 1), (-1, -1), (0, -2), (1, -1), (1, 1))
"""Steps to the neighbors in (rows, half spacings), in ring6's order; see HexagonalMesh."""

_ROUNDS = 8  # of fitting the number of points that a lens sees; two or three are usually enough
_MOST = 64  # times the wanted number of points; a lens that sees a smaller part of the picture counts as blind


@dataclass(frozen=True, eq=False)
class HexagonalMesh:
    """n pixels (n, 2), each `spacing` [px] from its six neighbors.

    neighbors: (n + 1, 6) positions in the mesh. Row n is the off-screen point, which replaces every missing neighbor
        and is linked to itself. The columns are right, upper right, upper left, left, lower left, lower right in the
        picture. An upright camera that looks ahead sees ring6's columns in the same directions: rings number their
        points counterclockwise from above, so their left is right in the picture, and their top is up.
    """

    pixels: Floats
    neighbors: Indices
    spacing: float

    def __len__(self) -> int:
        return len(self.pixels)

    def part(self, kept: npt.NDArray[np.intp]) -> HexagonalMesh:
        """The mesh of the points `kept`, in that order. Links to other points lead to the off-screen point."""
        position = np.full(len(self) + 1, len(kept), dtype=np.int32)
        position[kept] = np.arange(len(kept), dtype=np.int32)
        rows = self.neighbors[np.append(kept, len(self))]
        return HexagonalMesh(frozen(self.pixels[kept]), frozen(position[rows]), self.spacing)

    def on_screen(self, lens: Lens, size: Size) -> Mask:
        """Which points (n,) the lens sees; the circle of a fisheye may leave the corners of the picture black."""
        return lens.sees(lens.unproject(self.pixels, size))


def hexagonal_mesh(size: Size, count: int) -> HexagonalMesh:
    """A mesh over the whole picture with nearly `count` points: within 1 % from 1,200 on.

    All points are on screen in the sense of projection.project: the four pixels around each are in the picture.
    Raises InputError for fewer than one point, or a picture smaller than 2 x 2 px.
    """
    if count < 1 or min(size) < 2:
        raise InputError(f"a hexagonal mesh of {count} points does not fit a picture of {size[0]} x {size[1]} px")
    width, height = size[0] - 1.0, size[1] - 1.0
    rows, halves, spacing = _lattice(width, height, count)

    # Points are at every other place of a grid of rows and half columns.
    row, half = np.divmod(np.arange(rows * halves), halves)
    row, half = np.stack([row, half])[:, (row + half) % 2 == 0]
    pixels = np.empty((len(row), 2))
    pixels[:, 0] = (width - (halves - 1) * spacing / 2.0) / 2.0 + half * (spacing / 2.0)
    pixels[:, 1] = (height - (rows - 1) * spacing * ROW) / 2.0 + row * (spacing * ROW)

    # Position of the point at each place of the grid, with a border of places without one.
    places = np.full((rows + 2, halves + 4), len(row), dtype=np.int32)
    places[row + 1, half + 2] = np.arange(len(row), dtype=np.int32)
    neighbors = np.full((len(row) + 1, len(_STEPS)), len(row), dtype=np.int32)
    for column, (down, right) in enumerate(_STEPS):
        neighbors[:-1, column] = places[row + 1 + down, half + 2 + right]
    return HexagonalMesh(frozen(pixels), frozen(neighbors), spacing)


def visible_hexagonal_mesh(lens: Lens, size: Size, count: int) -> HexagonalMesh:
    """The part of a hexagonal mesh that the lens sees, with about `count` points in that part.

    Raises InputError as hexagonal_mesh does, and if the lens sees no part of the picture.
    """
    best, wanted = None, count
    for _ in range(_ROUNDS):
        mesh = hexagonal_mesh(size, wanted)
        shown = mesh.part(np.flatnonzero(mesh.on_screen(lens, size)))
        if best is None or abs(len(shown) - count) < abs(len(best) - count):
            best = shown
        if abs(len(best) - count) <= 0.005 * count or wanted >= _MOST * count:
            break
        wanted = min(max(round(wanted * min(count / max(len(shown), 1), 8.0)), 1), _MOST * count)
    if best is None or len(best) == 0:
        raise InputError(
            f"the lens sees no part of a picture of {size[0]} x {size[1]} px: check its center and field of view"
        )
    return best


def _lattice(width: float, height: float, count: int) -> tuple[int, int, float]:
    """The grid of a mesh: number of rows, of columns half a spacing apart, and the spacing [px].

    Points are at every other place of the grid. It fills the picture: no further row or column fits. Among such grids
    near the ideal spacing, this one has the number of points nearest to `count`.
    """
    ideal = math.sqrt(width * height / (ROW * count))
    rows, halves = np.meshgrid(_around(height / (ideal * ROW)), _around(2.0 * width / ideal))
    low = np.maximum(2.0 * width / (halves + 1), height / ((rows + 1) * ROW))
    with np.errstate(divide="ignore"):
        high = np.minimum(2.0 * width / (halves - 1), height / ((rows - 1) * ROW))
    high = high * (1.0 - 1e-9)  # the last row and column stay short of the border
    spacing = np.clip(ideal, low, high)
    off = np.abs((rows * halves + 1) // 2 - count) + 0.1 * np.abs(np.log(spacing / ideal))
    best = np.unravel_index(np.argmin(np.where(low <= high, off, np.inf)), off.shape)
    return int(rows[best]), int(halves[best]), float(spacing[best])


def _around(number: float) -> npt.NDArray[np.int64]:
    """The whole numbers, from 1 on, around a number."""
    return np.arange(max(math.floor(number) - 2, 1), math.floor(number) + 5)
