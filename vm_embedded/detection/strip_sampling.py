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
    """Colors of a canvas (rows, columns[, channels]), at pixels (m, 2) of the frame, one for each slot.

    levels: which picture of the pyramid colors each slot. on_screen (m,): the other slots have an arbitrary color.
    """
    shape = layout.shape
    canvas = np.zeros((*shape, *pyramid.level(0).shape[2:]), dtype=np.uint8)
    places = [pixels[:, axis].reshape(shape) for axis in range(2)]
    shown, halvings = on_screen.reshape(shape), levels.halvings.reshape(shape)
    for piece in layout.pieces:
        region = piece.region
        if not shown[region].any():
            continue
        level = int(halvings[region].max())
        scale = 0.5**level
        with np.errstate(over="ignore"):  # pixels count from the middle of the first one
            x, y = ((axis[region] * scale + 0.5 * (scale - 1.0)).astype(np.float32) for axis in places)
        canvas[region] = pyramid.at(level, x, y, shown[region])
    return canvas
