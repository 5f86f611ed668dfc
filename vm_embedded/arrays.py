"""Array types. Docstrings give the shapes: rays (n, 3), pixels (n, 2), neighbors (n + 1, N)."""

from __future__ import annotations

import math
from decimal import Decimal
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InputError

Floats = npt.NDArray[np.float64]
"""For geometry, in double precision, so that pixels agree with the reference to 1e-3 px."""

Singles = npt.NDArray[np.float32]
"""For the network's inputs and outputs."""

Indices = npt.NDArray[np.int32]
"""Indices of points in a mesh."""

Chosen = npt.NDArray[np.intp]
"""Positions of chosen elements in another array."""

Mask = npt.NDArray[np.bool_]

Image = npt.NDArray[np.uint8]
"""A picture, (height, width, channels) or (height, width)."""

AnyImage = npt.NDArray[Any]
"""What OpenCV returns as an image; functions that take one check its type and shape."""

Number = Any
"""A float or an array of floats; formulas of this type work on both."""


def number_or_nan(value: object) -> float:
    """A number of a JSON, TOML or YAML file; NaN for any other value, also for true, and for one too large for a float.

    So the check of a caller for its limits also rejects what is no number.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.nan


def numbers_or_nan(values: object) -> Floats:
    """A new array of these numbers, of any shape; a single NaN, of shape (), for anything else.

    So the check of a caller for finite numbers also rejects what is no array of numbers.
    """
    numbers = _numbers(values)
    return np.array(np.nan) if numbers is None else numbers


def one_number(value: object, name: str) -> float:
    """A number of Python or numpy, also as an array of one number, as OpenCV returns them.

    It may be NaN or infinite. Raises InputError with the name of the argument for anything else, also for true.
    """
    numbers = None if isinstance(value, list | tuple) else _numbers(value)
    if numbers is None or numbers.size != 1:
        raise InputError(f"{name} must be a number, not {str(value)[:60]!r} ({type(value).__name__})")
    return float(numbers.item())


def _numbers(values: object) -> Floats | None:
    """A new array of these numbers; None for anything else, such as texts that could be read as numbers."""
    try:
        given = np.asarray(values)
        if given.dtype.kind not in "iuf" and not all(isinstance(each, Real | Decimal) for each in given.flat):
            return None
        return given.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        return None


def frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The same array, made read-only."""
    array.flags.writeable = False
    return array
