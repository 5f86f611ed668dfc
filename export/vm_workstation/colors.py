"""Brightness and saturation of linear RGB colors."""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of red, green and blue in the brightness of a color (ITU-R BT.709)."""


def saturation_matrix(saturation: float) -> Floats:
    """Matrix (3, 3) that multiplies the saturation of RGB colors and keeps their brightness; 0 gives gray."""
    return np.asarray(saturation * np.eye(3) + (1.0 - saturation) * LUMINANCE)
