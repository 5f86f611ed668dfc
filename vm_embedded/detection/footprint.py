"""How much of the picture a point of the mesh stands for.

Between two rings near the camera lie many pixels. A point with the color of one of them shows a blade of grass or a
stroke of a print, by chance: a ball at one meter looks like noise, at six meters like a ball. A network for footprints
gets the mean color around each point instead. The picture is halved until its pixels are as large as the mesh is wide
at the point, so an object looks alike at every distance.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import Floats
from ..geometry.lens import Lens
from ..geometry.shape import Shape
from ..network.manifest import Manifest

Levels = tuple[npt.NDArray[np.intp], ...]
"""For each picture of the pyramid the points that it colors. Each picture is half as large as the one before."""

_MOST_HALVINGS = 7
"""Nothing is left of a picture after more."""


def footprint_levels(manifest: Manifest, rays: Floats, height: float, lens: Lens) -> Levels | None:
    """The points (n,) with rays (n, 3) that each picture colors, or None if the network samples single pixels.

    height: of the camera that the mesh is made for [m]. lens: fitted to the image.
    """
    if manifest.sampling == "bilinear":
        return None
    return levels_of(rays, manifest.mesh_shape, height, manifest.intersections, lens.scale)


def levels_of(rays: Floats, shape: Shape, height: float, intersections: float, scale: float) -> Levels:
    """The points (n,) with rays (n, 3) of a mesh that each picture colors.

    The mesh is made for a shape seen from a height [m], with `intersections` rings k across an object. At an
    inclination phi the object's angular radius is r cos(phi) / (h - c), with c the height of its center. So rings are
    2 r cos(phi) / (k (h - c)) apart; for a flat circle that is the distance within a ring. scale: of the lens on its
    axis [px/rad].
    """
    widest = 2.0 * shape.radius * scale / (intersections * (height - shape.center_height))
    width = widest * np.maximum(np.nan_to_num(-rays[:, 2]), 0.0)
    level = np.clip(np.floor(np.log2(np.maximum(width, 1.0))), 0, _MOST_HALVINGS).astype(np.intp)
    return tuple(np.flatnonzero(level == each) for each in range(int(level.max(initial=0)) + 1))


def uniform_levels(count: int, width: float) -> Levels:
    """The levels of `count` points that are all `width` apart [px]."""
    level = int(np.clip(np.floor(np.log2(max(width, 1.0))), 0, _MOST_HALVINGS))
    return (*(np.empty(0, dtype=np.intp) for _ in range(level)), np.arange(count))
