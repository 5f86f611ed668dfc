"""Array types. Their shapes stand in the docstrings: rays (n, 3), pixels (n, 2), neighbors (n + 1, N)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
"""Geometry is double precision: pixels agree with the reference to 1e-3 px."""

Singles = npt.NDArray[np.float32]
"""What the network takes and gives."""

Indices = npt.NDArray[np.int32]
"""Neighbor indices and positions in a mesh."""

Mask = npt.NDArray[np.bool_]

Image = npt.NDArray[np.uint8]
"""(height, width, channels) or (height, width)."""

Number = Any
"""A float, or an array of them: formulas in this project work on both."""


def frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The same array, made read-only."""
    array.flags.writeable = False
    return array
