"""How much of the picture a point of the mesh stands for.

Between two rings near the camera lie many pixels. A point with the color of one of them shows a blade of grass or a
stroke of a print, by chance: a ball at one meter looks like noise, at six meters like a ball. A network for footprints
gets the mean color around each point instead. The picture is halved until its pixels are as large as the mesh is wide
at the point, so an object looks alike at every distance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import Floats, frozen
from ..geometry.lens import Lens
from ..geometry.shape import Shape
from ..mesh.mesh import Mesh
from ..mesh.octaves import strip_rays
from ..network.manifest import Manifest

BLOCK = 64
"""Points that are sampled together; each level has whole blocks."""

_MOST_HALVINGS = 7
"""Nothing is left of a picture after more."""


@dataclass(frozen=True, eq=False)
class Levels:
    """Which picture of the pyramid colors each of n points. Each picture is half as large as the one before.

    order (p,): the points, those of the first picture first. The share of each picture is filled up to whole blocks:
    its last point is repeated. places (n,): where each point is in `order`. ends: for each picture, the number of
    blocks up to the end of its share. halvings (n,): how often the picture of each point is halved.
    """

    order: npt.NDArray[np.intp]
    places: npt.NDArray[np.intp]
    ends: tuple[int, ...]
    halvings: npt.NDArray[np.int8]

    @classmethod
    def of(cls, level: npt.NDArray[np.integer]) -> Levels:
        """For points with these levels (n,): the picture halved so many times colors a point."""
        shares = [np.flatnonzero(level == each) for each in range(int(level.max(initial=0)) + 1)]
        filled = [np.pad(share, (0, -len(share) % BLOCK), mode="edge") if len(share) else share for share in shares]
        blocks = np.cumsum([len(each) // BLOCK for each in filled])
        order = np.concatenate(filled)
        places = np.empty(len(level), dtype=np.intp)
        places[order] = np.arange(len(order))
        return cls(frozen(order), frozen(places), tuple(blocks.tolist()), frozen(level.astype(np.int8)))

    def shares(self) -> Iterator[tuple[int, slice]]:
        """The pictures that color points: how often each was halved, and its blocks."""
        start = 0
        for level, end in enumerate(self.ends):
            if end > start:
                yield level, slice(start, end)
            start = end

    @property
    def nbytes(self) -> int:
        """Memory that it holds [bytes]."""
        return self.order.nbytes + self.places.nbytes + self.halvings.nbytes


def levels_for(manifest: Manifest, mesh: Mesh, height: float, lens: Lens) -> Levels:
    """The levels of a mesh's points. A network that samples single pixels takes all from the whole picture.

    height: of the camera that the mesh is made for [m]. lens: fitted to the image.
    """
    if manifest.sampling == "bilinear":
        return uniform_levels(len(mesh), 1.0)
    shape, k = manifest.mesh_shape, manifest.intersections
    if mesh.strips is None:
        return Levels.of(level_of(footprint_widths(mesh.rays, shape, height, k, lens.scale)))
    # One width for each strip, whatever part of the strip is in the mesh.
    middle = strip_rays(shape, height, k, manifest.max_distance)
    return Levels.of(level_of(footprint_widths(middle, shape, height, k, lens.scale))[mesh.strips])


def footprint_widths(rays: Floats, shape: Shape, height: float, intersections: float, scale: float) -> Floats:
    """How wide (n,) [px] the areas are that a mesh's points with rays (n, 3) stand for; 0 above the horizon.

    The mesh is made for a shape seen from a height [m], with `intersections` rings k across an object. At an
    inclination phi the object's angular radius is r cos(phi) / (h - c), with c the height of its center. So rings are
    2 r cos(phi) / (k (h - c)) apart; for a flat circle that is the distance within a ring. scale: of the lens on its
    axis [px/rad].
    """
    widest = 2.0 * shape.radius * scale / (intersections * (height - shape.center_height))
    return np.asarray(widest * np.maximum(np.nan_to_num(-rays[:, 2]), 0.0))


def uniform_levels(count: int, width: float) -> Levels:
    """The levels of `count` points that are all `width` apart [px]."""
    return Levels.of(level_of(np.full(count, width)))


def level_of(width: Floats) -> npt.NDArray[np.integer]:
    """The smallest picture whose pixels are at most `width` (n,) [px] wide."""
    return np.clip(np.floor(np.log2(np.maximum(width, 1.0))), 0, _MOST_HALVINGS).astype(np.int8)
