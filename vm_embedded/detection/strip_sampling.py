"""The colors of the picture on a canvas of strips: one call of OpenCV for each strip.

All cells of a strip stand for areas of about the same size, so one picture of the pyramid colors them. OpenCV rounds
colors to whole gray levels. Networks on a canvas see far around each cell and don't depend on a level; in return, this
takes a quarter of the time of `sample`.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Image, Mask
from ..network.canvas_layout import CanvasLayout
from .footprint import Levels
from .pyramid import Pyramid


def sample_strips(pyramid: Pyramid, pixels: Floats, levels: Levels, layout: CanvasLayout, on_screen: Mask) -> Image:
    """Colors of a canvas (rows, columns[, channels]), from pixels (n, 2) of the mesh's points.

    levels: which picture of the pyramid colors each point. on_screen (n,): the other points, and cells without a point,
    have an arbitrary color.
    """
    shape = layout.shape
    canvas = np.zeros((*shape, *pyramid.level(0).shape[2:]), dtype=np.uint8)
    shown = layout.spread(on_screen).reshape(shape)
    with np.errstate(over="ignore"):
        places = [layout.spread(each).reshape(shape) for each in pixels.T.astype(np.float32)]
    for piece in layout.pieces:
        region = piece.region
        if shown[region].any():
            level = int(levels.halvings[piece.point])
            scale = np.float32(0.5**level)
            # Pixels count from the middle of the first one.
            x, y = (each[region] * scale + (scale - np.float32(1.0)) * np.float32(0.5) for each in places)
            canvas[region] = pyramid.at(level, x, y, shown[region])
    return canvas
