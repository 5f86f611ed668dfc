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
    """Red, green and blue (3, m), from 0 to 1, at pixels (m, 2) of the frame, one for each slot of a canvas.

    levels: which picture of the pyramid colors each slot. The color is arbitrary where a pixel is outside of the image.
    """
    frame = pyramid.level(0)
    canvas = np.zeros((*layout.shape, *frame.shape[2:]), dtype=np.uint8)
    places = pixels.reshape(*layout.shape, 2)
    halvings = levels.halvings.reshape(layout.shape)
    for piece in layout.pieces:
        level = int(halvings[piece.region].max())
        with np.errstate(over="ignore"):
            at = places[piece.region].astype(np.float32)
        at += 0.5  # pixels count from the middle of the first one
        at *= 0.5**level
        at -= 0.5
        colors = cv2.remap(pyramid.level(level), at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
        canvas[piece.region] = colors
    planes = np.asarray(cv2.dnn.blobFromImage(canvas, 1.0 / 255.0), dtype=np.float32)  # one for each channel
    return planes.reshape(-1, len(pixels))[list(pyramid.channels)]
