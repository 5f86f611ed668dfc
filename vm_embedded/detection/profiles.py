"""Brightness of the picture along short stretches of the plane."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from ..arrays import Floats, Singles
from .prepared_view import PreparedView
from .pyramid import Pyramid

_MEAN = np.array([[1.0, 1.0, 1.0, 0.0]]) / 3.0
"""Shares of the channels in the brightness; the last one is alpha, if there is one."""


def brightness_along(view: PreparedView, pyramid: Pyramid, stretches: Floats, count: int) -> tuple[Singles, Floats]:
    """Brightness (n, count), 0 to 255, at evenly spaced places from one end to the other of stretches (n, 2, 2) [m] on
    the plane, from below the camera, NaN outside of the picture, and the pixels (n,) between two of these places.

    view: of the frame. pyramid: the frame; only its first level is read. The lens projects both ends and the middle of
    each stretch; a parabola through them gives the other places.
    """
    nodes = np.concatenate([stretches[:, 0], 0.5 * (stretches[:, 0] + stretches[:, 1]), stretches[:, 1]])
    known = view.plane_pixels(nodes).T.reshape(2, 3, -1)  # x and y of the nodes
    x, y = pixels = known.transpose(0, 2, 1).astype(np.float32) @ _shares(count).T  # (2, n, count)
    width, height = view.size
    hidden = ~((x >= 0.0) & (x <= width - 1.0) & (y >= 0.0) & (y <= height - 1.0))
    pixels[:, hidden] = -1.0
    colors = cv2.remap(pyramid.level(0), x, y, cv2.INTER_LINEAR)
    gray = colors if colors.ndim == 2 else cv2.transform(colors, _MEAN[:, : colors.shape[2]])
    brightness = gray.astype(np.float32)
    brightness[hidden] = np.nan
    along = known[:, 2] - known[:, 0]
    return brightness, np.nan_to_num(np.hypot(along[0], along[1]) / (count - 1))


@lru_cache(maxsize=4)
def _shares(count: int) -> Singles:
    """Shares (count, 3) of the two ends and the middle between them in evenly spaced places."""
    at = np.linspace(0.0, 1.0, count, dtype=np.float32)
    return np.stack([(1.0 - at) * (1.0 - 2.0 * at), 4.0 * at * (1.0 - at), at * (2.0 * at - 1.0)], axis=1)
