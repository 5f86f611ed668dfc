"""A hint for a user whose objects have another size than the detector expects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..detection.detection import Detection

_FEWEST = 5
"""Objects that are needed for a hint."""

_LARGE = 6.0
"""Least radius of an object whose size is measured [px]."""

_DIFFERENT, _ALIKE = 0.1, 0.15
"""Least difference of the median size from the expected one, and largest difference between the quartiles."""


def size_ratios(found: Iterable[Detection]) -> list[float]:
    """Apparent sizes of the objects that are large enough to measure, each divided by the expected size."""
    return [each.distance / each.distance_by_angle for each in found if each.radius >= _LARGE]


def size_hint(ratios: Sequence[float], radius: float) -> str:
    """A line if these ratios agree on another size than that of the expected radius [m]; empty if not."""
    if len(ratios) < _FEWEST:
        return ""
    first, median, third = np.quantile(ratios, [0.25, 0.5, 0.75]).tolist()
    if abs(median - 1.0) < _DIFFERENT or third - first > _ALIKE:
        return ""
    return (
        f"the objects look {median:.2f} times as large as expected: check --object-radius (it is {radius:g}; "
        f"{median * radius:.3f} would fit), --height and the lens"
    )
