"""The colors of the picture on a canvas of strips: one call of OpenCV for each strip.

All cells of a strip stand for areas of about the same size, so one picture of the pyramid colors them. OpenCV rounds
colors to whole gray levels. Networks on a canvas see far around each cell and don't depend on a level; in return, this
takes a quarter of the time of `sample`.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import Floats, Singles
from ..network.canvas_layout import CanvasLayout
from .footprint import Levels
from .pyramid import Pyramid


def sample_strips(pyramid: Pyramid, pixels: Floats, levels: Levels, layout: CanvasLayout) -> Singles:
    """Red, green and blue (3, m), from 0 to 1, of the cells of a canvas, from pixels (n, 2) of the mesh's points.

    levels: which picture of the pyramid colors each point. The color is arbitrary in cells without a point, and where a
    pixel is outside of the image.
    """
    frame = pyramid.level(0)
    canvas = np.zeros((*layout.shape, *frame.shape[2:]), dtype=np.uint8)
    with np.errstate(over="ignore"):
        places = [layout.spread(each).reshape(layout.shape) for each in pixels.T.astype(np.float32)]
    for piece in layout.pieces:
        level, region = int(levels.halvings[piece.point]), piece.region
        # Pixels count from the middle of the first one.
        x, y = ((each[region] + 0.5) * 0.5**level - 0.5 for each in places)
        colors = cv2.remap(pyramid.level(level), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        canvas[region] = colors
    planes = np.asarray(cv2.dnn.blobFromImage(canvas, 1.0 / 255.0), dtype=np.float32)  # one for each channel
    return planes.reshape(len(planes[0]), -1)[list(pyramid.channels)]
